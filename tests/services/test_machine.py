"""What a machine or a container has, and whether a folder keeps two writers apart."""

import errno
import fcntl
import os
import shutil
from pathlib import Path

import pytest

from services import folder_probe
from services.cluster.clock import Offset
from services.errors import HomeError
from services.folder_probe import probed_folder
from services.machine import free_memory, nearest, processors, room


def tree(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def test_a_container_may_use_what_its_limit_says(tmp_path):
    all_of_them = processors(tmp_path / "none")
    assert all_of_them >= 1.0
    assert processors(tree(tmp_path / "v2", {"cpu.max": "50000 100000\n"})) == 0.5
    assert processors(tree(tmp_path / "free", {"cpu.max": "max 100000\n"})) == all_of_them
    old = {"cpu/cpu.cfs_quota_us": "25000\n", "cpu/cpu.cfs_period_us": "100000\n"}
    assert processors(tree(tmp_path / "v1", old)) == 0.25
    unlimited = {**old, "cpu/cpu.cfs_quota_us": "-1\n"}
    assert processors(tree(tmp_path / "v1-free", unlimited)) == all_of_them


def test_free_memory_is_the_machines_or_what_the_container_has_left(tmp_path):
    machine = tmp_path / "meminfo"
    machine.write_text("MemTotal: 4000 kB\nMemAvailable: 2000 kB\n")
    assert free_memory(tmp_path, machine) == 2000 * 1024
    limited = {
        "memory.max": "1000000",
        "memory.current": "800000",
        "memory.stat": "anon 1\ninactive_file 300000\n",
    }
    assert free_memory(tree(tmp_path / "v2", limited), machine) == 500_000
    assert free_memory(tree(tmp_path / "v2", {"memory.max": "max"}), machine) == 2000 * 1024
    old = {
        "memory/memory.limit_in_bytes": "700000",
        "memory/memory.usage_in_bytes": "900000",
        "memory/memory.stat": "total_inactive_file 100000\n",
    }
    assert free_memory(tree(tmp_path / "v1", old), machine) == 0
    assert free_memory(tmp_path, tmp_path / "absent") is None


def test_room_is_that_of_the_disk_on_which_a_folder_would_lie(tmp_path):
    assert nearest(tmp_path / "a" / "b") == tmp_path
    assert room(tmp_path / "a" / "b").total == shutil.disk_usage(tmp_path).total


def test_a_folder_is_left_as_it_was(tmp_path):
    with probed_folder(tmp_path) as own:
        assert own.parent == tmp_path
        assert own.is_dir()
    assert list(tmp_path.iterdir()) == []


def refusing(*_):
    raise OSError(errno.EOPNOTSUPP, os.strerror(errno.EOPNOTSUPP))


def test_a_file_system_without_links_or_locks_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "link", refusing)
    with pytest.raises(HomeError, match=r"cannot link .*not supported.*; put the home on"):
        probed_folder(tmp_path).__enter__()
    monkeypatch.undo()
    monkeypatch.setattr(fcntl, "flock", refusing)
    with pytest.raises(HomeError, match=r"cannot lock files .*; put the home on"):
        probed_folder(tmp_path).__enter__()
    assert list(tmp_path.iterdir()) == []


def test_a_file_system_that_overwrites_or_only_pretends_to_lock_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "link", shutil.copy)
    with pytest.raises(HomeError, match="would overwrite one another's commits"):
        probed_folder(tmp_path).__enter__()
    monkeypatch.undo()
    monkeypatch.setattr(fcntl, "flock", lambda *_: None)
    with pytest.raises(HomeError, match="lock files for one writer alone"):
        probed_folder(tmp_path).__enter__()


def test_a_folder_that_cannot_be_written_to_is_refused(tmp_path):
    with pytest.raises(HomeError, match=r"cannot be written to .*; mend its permissions"):
        probed_folder(tmp_path / "absent").__enter__()


def test_whoever_makes_a_home_meanwhile_takes_the_probe_for_nothing_foreign(tmp_path):
    from services.home import Home

    with probed_folder(tmp_path) as own:
        assert own.name.startswith(folder_probe.PREFIX)
        Home.open(tmp_path, create=True)


def test_an_exchange_bounds_a_clock_by_what_it_took():
    offset = Offset.told(sent=100.0, there=105.0, heard=100.5)
    assert (offset.low, offset.high) == (4.5, 5.0)
    assert offset.surely == 4.5
    assert str(offset) == "4.8 s ahead (±0.25 s)"
    assert Offset.told(100.0, 100.2, 100.5).surely == 0.0
    assert str(Offset.told(100.0, 100.2, 100.5)).startswith("the same")
    behind = Offset.told(100.0, 90.0, 100.5)
    assert behind.surely == 10.0
    assert "behind" in str(behind)


def test_exchanges_tell_more_together_and_offsets_add_up():
    one, other = Offset(-0.2, 0.3), Offset(0.1, 0.6)
    assert one.narrowed(other) == Offset(0.1, 0.3)
    assert one.narrowed(Offset(5.0, 6.0)) == Offset(5.0, 6.0)
    assert one + other == Offset(-0.1, 0.8999999999999999)
