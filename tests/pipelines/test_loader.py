"""Segments as tensors: the rows of the table in their order, on memory that nothing copies."""

import json
import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
import torch

from lmtr.errors import DataError
from lmtr.models.tensors import SegmentTensors
from lmtr.vectors.layout import TASK_LAYOUT
from pipelines.loader import load_segments, stream_segments
from services.home import Home
from services.lake.tables import Lake


@pytest.fixture(scope="module")
def rows(tiny_home) -> pa.Table:
    lake = Lake(Home.open(tiny_home, create=False).lake)
    return lake.read("segments", order_by="solution_index, epoch_s, goal_time_s")


def test_tensors_are_the_tables_rows_in_order(tiny_home, rows):
    data = load_segments(tiny_home)
    for name, tensor in (("x", data.x), ("tau", data.tau)):
        expected = rows[name].combine_chunks().flatten().to_numpy().reshape(len(rows), -1)
        np.testing.assert_array_equal(tensor.numpy(), expected)
    for name in ("solution_index", "epoch_s", "goal_time_s"):
        np.testing.assert_array_equal(getattr(data, name), rows[name].to_numpy())
    again = load_segments(tiny_home, data.cut.dataset_id, version=data.cut.version)
    assert torch.equal(again.tau, data.tau)
    train, validation = (load_segments(tiny_home, split=s) for s in ("train", "validation"))
    splits = rows["split"].to_pylist()
    assert (len(train), len(validation)) == (splits.count("train"), splits.count("validation"))


def test_streams_share_arrows_memory_and_hold_the_same(tiny_home, monkeypatch):
    lent = []
    flatten = SegmentTensors.sharing.__func__

    def watched(cls, x, tau):
        made = flatten(cls, x, tau)
        lent.append((x.__array_interface__["data"][0], made.x.data_ptr()))
        return made

    monkeypatch.setattr(SegmentTensors, "sharing", classmethod(watched))
    parts = list(stream_segments(tiny_home))
    assert lent
    assert all(mine == theirs for mine, theirs in lent)
    found, everything = (
        {row.tobytes() for x, tau in pairs for row in np.hstack([x.numpy(), tau.numpy()])}
        for pairs in ([(part.x, part.tau) for part in parts], [_both(load_segments(tiny_home))])
    )
    assert found == everything


def _both(data):
    return data.x, data.tau


def test_batches_are_all_pairs_once_in_a_drawn_order(tiny_home):
    data = load_segments(tiny_home)
    drawn = [part.x for part in data.batches(7, torch.Generator().manual_seed(1))]
    again = [part.x for part in data.batches(7, torch.Generator().manual_seed(1))]
    assert all(torch.equal(a, b) for a, b in zip(drawn, again, strict=True))
    assert {len(part) for part in drawn[:-1]} == {7}
    assert torch.equal(
        torch.cat(drawn).sum(0, dtype=torch.float64).round(decimals=4),
        data.x.sum(0, dtype=torch.float64).round(decimals=4),
    )
    assert next(data.batches(7)).x.data_ptr() == data.x.data_ptr()


def test_a_version_without_segments_says_so(tiny_home):
    with pytest.raises(DataError, match="has no segments in version 0"):
        load_segments(tiny_home, version=0)


def test_pairs_must_be_pairs():
    with pytest.raises(DataError, match="must be as many rows, got 2 and 3"):
        SegmentTensors.sharing(np.zeros((2, 35), np.float32), np.zeros((3, 264), np.float32))


def test_the_example_of_the_page_runs(tiny_home, monkeypatch, capsys):
    page = (Path(__file__).parents[2] / "docs" / "data.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```python\n(.*?)```", page, re.S)
    exec(example.replace("lmtr-home", str(tiny_home)).replace("512", "4"), {})
    assert "torch.Size([4, 35]) torch.Size([4, 264])" in capsys.readouterr().out


def test_segments_leave_as_numpy_arrays_with_their_layouts(lmtr, tiny_home, rows, tmp_path):
    out = tmp_path / "segments.npz"
    status, said, _ = lmtr("export", "segments", "--format", "npz", "-o", out, "--home", tiny_home)
    assert (status, said) == (0, f"{out}: {len(rows)} rows\n")
    arrays = np.load(out)
    np.testing.assert_array_equal(arrays["tau"], load_segments(tiny_home).tau.numpy())
    for name in ("solution_index", "epoch_s", "goal_time_s", "split"):
        assert arrays[name].tolist() == rows[name].to_pylist()
    assert json.loads(str(arrays["layouts"]))["task"] == TASK_LAYOUT.metadata()
    status, _, err = lmtr("export", "solutions", "--format", "npz", "-o", out, "--home", tiny_home)
    assert status == 2
    assert "are no arrays" in err
