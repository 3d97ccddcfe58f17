"""Rows of one piece of work: there once, and again after a repair took them out."""

from datetime import UTC, datetime

from services.lake.once import append_once

MADE = {"code_version": "0", "created_at": datetime(2026, 11, 26, tzinfo=UTC)}


def cut(dataset_id):
    return {"dataset_id": dataset_id, "segmentation_id": "c'", "settings": "{}", **MADE}


def test_rows_are_there_once_and_come_back_when_they_were_taken_out(lake):
    assert append_once(lake, "cuts", [cut("a")], "a")
    assert not append_once(lake, "cuts", [cut("a")], "a")
    assert not append_once(lake, "cuts", [cut("a")], "another name")
    assert append_once(lake, "cuts", [cut("b")], "b")
    lake.delete("cuts", "dataset_id = 'a'")
    assert append_once(lake, "cuts", [cut("a")], "a")
    assert sorted(lake.values("cuts", "dataset_id")) == ["a", "b"]
