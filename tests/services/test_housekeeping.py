"""Housekeeping that fails is told and ends nothing: the rows are kept already."""

import logging
import time

import pytest
from s3_servers import BUCKET

from services.lake import sink as sink_module
from services.lake.appender import Group
from services.lake.exclusive import LOCK, rewriting
from services.lake.housekeeping import join_files
from services.lake.sink import TableSink
from services.lake.storage import Storage
from services.lake.tables import Lake


@pytest.fixture
def said(caplog):
    """What was warned of."""
    return lambda: [each.getMessage() for each in caplog.records if each.levelno >= logging.WARNING]


def once(said):
    """The one warning of a writer, whose files are joined beside its commits."""
    until = time.monotonic() + 10.0
    while not said() and time.monotonic() < until:
        time.sleep(0.02)
    (warning,) = said()
    return warning


@pytest.fixture
def sink(monkeypatch):
    """Makes writers that join files after every second commit."""
    monkeypatch.setattr(sink_module, "COMPACT_EVERY", 2)
    group = Group("solutions", {"dataset_id": "a"}, "index")
    return lambda storage: TableSink(storage, group)


@pytest.fixture
def stored(moto, reach, prefix):
    """A lake in an object store whose lock a writer has left behind that was killed."""
    reach(moto)
    moto.client().put_object(
        Bucket=BUCKET, Key=f"{prefix}/solutions/{LOCK}", Body=b"process 7 on elsewhere\n"
    )
    return Lake(f"s3://{BUCKET}/{prefix}")


def test_a_damaged_file_does_not_end_a_writer(full, damage, sink, solutions, said):
    write = sink(full.storage)
    write([solutions([20])], {})
    path = damage.file_with(0)
    path.write_bytes(path.read_bytes()[:-200] + b"x" * 200)
    for number in (21, 22):
        version = full.version("solutions")
        assert write([solutions([number])], {}).appended.version == version + 1
    warning = once(said)
    assert "no row is lost" in warning
    assert path.stem[:30] in warning  # long messages are cut
    assert "`lmtr lake check`" in warning


def test_a_lock_left_behind_in_a_store_is_named(stored, sink, solutions, said, moto, prefix):
    write = sink(stored.storage)
    for number in (1, 2):
        assert write([solutions([number])], {}).appended.rows == 1
    warning = once(said)
    address = f"s3://{BUCKET}/{prefix}/solutions/{LOCK}"
    assert f"process 7 on elsewhere holds {address}" in warning
    assert "delete that object" in warning
    moto.client().delete_object(Bucket=BUCKET, Key=f"{prefix}/solutions/{LOCK}")
    join_files(stored, "solutions")
    assert stored.history("solutions")[0]["operation"] == "OPTIMIZE"
    assert len(said()) == 1


def test_another_process_at_it_on_this_disk_is_not_worth_a_word(full, said):
    with rewriting(full.storage, "solutions"):
        join_files(full, "solutions")
    assert said() == []
    assert full.history("solutions")[0]["operation"] == "WRITE"


def test_a_lock_that_cannot_be_opened_is_named(full, damage, said):
    (damage.folder / LOCK).mkdir()
    join_files(full, "solutions")
    (warning,) = said()
    assert f"check space and permissions of {damage.folder / LOCK}" in warning


def test_a_table_that_is_not_there_ends_nothing(tmp_path, said):
    join_files(Lake(Storage.at(tmp_path)), "solutions")
    assert len(said()) == 1
