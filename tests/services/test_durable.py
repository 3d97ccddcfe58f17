"""A power cut after a commit was confirmed: what had not been flushed is gone."""

import os
import shutil
from pathlib import Path

import pytest

from services.errors import LakeError
from services.lake import durable
from services.lake.appender import Appender, Group
from services.lake.tables import Lake


class Disk:
    """Keeps what was flushed, as it was then: content of files, names in folders."""

    def __init__(self, root, flush):
        self._root = root
        self._flush = flush
        self._contents = {}
        self._names = {}

    def fsync(self, descriptor):
        path = Path(os.readlink(f"/proc/self/fd/{descriptor}"))
        self._flush(descriptor)
        if path.is_dir():
            self._names[path] = [entry.name for entry in path.iterdir()]
        else:
            self._contents[path] = path.read_bytes()

    def cut_power(self, to):
        """Make what is left; files that were named and not flushed are empty, as on ext4."""
        shutil.rmtree(to, ignore_errors=True)
        self._restore(self._root, to)
        return Lake(to / "lake")

    def _restore(self, path, to):
        to.mkdir()
        for name in self._names.get(path, ()):
            if (path / name).is_dir():
                self._restore(path / name, to / name)
            else:
                (to / name).write_bytes(self._contents.get(path / name, b""))


@pytest.fixture
def disk(tmp_path, monkeypatch):
    root = tmp_path / "home"
    root.mkdir()
    disk = Disk(root, os.fsync)
    monkeypatch.setattr(os, "fsync", disk.fsync)
    return disk


@pytest.fixture
def lake(tmp_path, disk):
    return Lake(tmp_path / "home" / "lake")


@pytest.fixture
def left(disk, tmp_path):
    """Indices of solutions that are left after a power cut."""
    return lambda: sorted(disk.cut_power(tmp_path / "left").values("solutions", "index"))


def test_confirmed_rows_outlast_a_power_cut(lake, solutions, left):
    for number in (1, 2, 3):
        lake.append("solutions", solutions([number]), app_id="x", number=number)
        assert left() == list(range(1, number + 1))


def test_so_do_those_of_writers_in_turn(lake, solutions, left):
    group = Group("solutions", {"dataset_id": "a"}, "index")
    writers = [Appender(Lake(lake.storage), group) for _ in range(2)]
    for number in range(6):
        writers[number % 2].append(solutions([number]))
        assert left() == list(range(number + 1))


def test_an_entry_of_a_writer_that_has_not_confirmed_it_spoils_no_later_one(
    lake, solutions, put, left
):
    lake.append("solutions", solutions([0]), app_id="x", number=1)
    put(lake, "solutions", solutions([1]))
    assert left() == [0]
    lake.append("solutions", solutions([2]), app_id="x", number=2)
    assert left() == [0, 1, 2]


def test_compaction_and_deletion_leave_a_whole_table(lake, solutions, left):
    for number in (1, 2, 3):
        lake.append("solutions", solutions([number]), app_id="x", number=number)
    lake.compact("solutions")
    assert left() == [1, 2, 3]
    lake.delete("solutions", "index = 2")
    assert left() == [1, 3]


def test_checkpoints_that_delta_makes_by_itself_are_whole(lake, datasets, disk, tmp_path):
    for number in range(1, 103):
        lake.append("datasets", datasets([f"d{number}"]), app_id="x", number=number)
    rest = disk.cut_power(tmp_path / "left")
    assert rest.read("datasets").num_rows == 102
    log = rest.storage.folder / "datasets" / "_delta_log"
    assert (log / "_last_checkpoint").read_bytes()
    assert all(path.stat().st_size for path in log.iterdir())


def test_a_checkpoint_without_its_hint_hinders_no_commit(lake, solutions, left):
    lake.append("solutions", solutions([1]), app_id="x", number=1)
    lake.delta("solutions").create_checkpoint()
    (lake.storage.folder / "solutions" / durable.HINT).unlink()
    again = Lake(lake.storage)
    again.append("solutions", solutions([2]), app_id="x", number=2)
    assert left() == [1, 2]


def test_each_version_is_flushed_once(lake, solutions, monkeypatch):
    flushed = []
    flush = durable._flush
    monkeypatch.setattr(durable, "_flush", lambda path: (flushed.append(path), flush(path)))
    for number in range(1, 6):
        lake.append("solutions", solutions([number]), app_id="x", number=number)
    kinds = (".json", ".parquet")
    files = [path for path in flushed if path.suffix in kinds and path.exists()]
    assert len(files) == len(set(files)) == 6 + 5


def test_after_a_log_was_taken_back_new_versions_are_flushed(lake, solutions, left):
    for number in (1, 2, 3):
        lake.append("solutions", solutions([number]), app_id="x", number=number)
    for version in (3, 2):
        (lake.storage.folder / "solutions" / f"_delta_log/{version:020}.json").unlink()
    lake.append("solutions", solutions([4]), app_id="y", number=1)
    assert left() == [1, 4]


def test_a_disk_that_refuses_is_named(lake, solutions, monkeypatch):
    def refuse(descriptor):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(LakeError, match=r"'solutions' cannot be written: .*Input/output error"):
        lake.append("solutions", solutions([1]), app_id="x", number=1)
