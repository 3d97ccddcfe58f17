"""What a table takes up and how it came about; what a vacuum deletes and what it never does."""

import os
import shutil
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from deltalake import CommitProperties, write_deltalake

from services.errors import LakeError
from services.lake import maintenance
from services.lake.schemas import SCHEMAS

HOUR = timedelta(hours=1)


@pytest.fixture
def stray(full, damage):
    """A data file that no version refers to, as a killed writer leaves it."""
    path = damage.folder / "part-stray.parquet"
    shutil.copy(damage.file_with(0), path)
    return path


def aged(path, hours):
    when = datetime.now(UTC).timestamp() - 3600.0 * hours
    os.utime(path, (when, when))


def test_a_table_is_told_in_figures(full, solutions):
    full.append("solutions", solutions([0, 1], dataset_id="b"), app_id="y", number=1)
    full.compact("solutions")
    told = maintenance.info(full, "solutions")
    assert (told.rows, told.files, told.version, told.schema_version) == (14, 1, 5, "2")
    assert (told.log_entries, told.by_dataset) == (6, {"a": 12, "b": 2})
    assert 0 < told.nbytes < told.stored_bytes


def test_history_tells_what_the_writer_noted(full, solutions):
    notes = CommitProperties(custom_metadata={"lmtr.note": "by hand"})
    rows = solutions([20, 21])
    write_deltalake(full.open_or_create("solutions"), rows, mode="append", commit_properties=notes)
    newest, *older = maintenance.history(full, "solutions")
    assert (newest["version"], newest["operation"], newest["rows"]) == (4, "WRITE", 2)
    assert newest["notes"] == {"lmtr.note": "by hand"}
    assert [each["version"] for each in older] == [3, 2, 1, 0]
    assert abs(newest["when"] - datetime.now(UTC)) < HOUR


def test_only_an_old_file_that_no_version_mentions_goes(full, damage, stray):
    full.compact("solutions")  # its sources belong to older versions and stay
    assert maintenance.orphans(full, "solutions") == []
    aged(stray, 2)
    unneeded = maintenance.orphans(full, "solutions")
    assert [each.path for each in unneeded] == [stray.name]
    maintenance.remove(full, "solutions", unneeded)
    assert not stray.exists()
    assert [full.read("solutions", version=v).num_rows for v in range(5)] == [0, 4, 8, 12, 12]


def test_a_clock_that_jumps_ahead_makes_no_file_old(full, stray):
    ahead = datetime.now(UTC) + timedelta(days=400)
    assert maintenance.orphans(full, "solutions", HOUR, now=ahead) == []


def test_forgetting_keeps_the_newest_and_the_pinned_version(lake, segments, put):
    for number in (1, 2, 3):
        rows = segments(*(number * np.ones((2, n)) for n in (35, 264)))
        lake.append("segments", rows, app_id="x", number=number)
        lake.compact("segments")
    model = {f.name: None for f in SCHEMAS["models"]} | {
        "model_id": "m",
        "dataset_id": "a",
        "segmentation_id": "cut",
        "segments_version": 3,
        "latent": 3,
        "seed": 0,
        "settings": "{}",
        "metrics": [],
        "folder": "m",
        "mlflow_run_id": "r",
        "code_version": "0",
        "created_at": datetime(2026, 11, 22, tzinfo=UTC),
    }
    lake.append_rows("models", [model], app_id="m")
    assert maintenance.pinned_versions(lake, "segments") == {3}
    counts = {v: lake.read("segments", version=v).num_rows for v in (3, lake.version("segments"))}
    unneeded = maintenance.forgotten(lake, "segments", timedelta(0))
    assert unneeded
    maintenance.remove(lake, "segments", unneeded)
    assert {v: lake.read("segments", version=v).num_rows for v in counts} == counts
    assert maintenance.forgotten(lake, "segments", timedelta(0)) == []


def test_nothing_is_deleted_by_a_log_that_is_damaged(full, damage, stray):
    aged(stray, 2)
    damage.tear(2, b"")
    for find in (maintenance.orphans, maintenance.forgotten):
        with pytest.raises(LakeError, match=r"its log is damaged, .*`lmtr lake repair` first"):
            find(full, "solutions")
