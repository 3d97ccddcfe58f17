"""The home folder: made once, found again, never taken from somebody else."""

import json
import os
from pathlib import Path

import pytest

from services.errors import HomeError
from services.home import Home


def test_a_home_is_made_once_and_found_again(tmp_path):
    made = Home.open(tmp_path / "deep" / "home", create=True)
    assert Home.open(made.root, create=False) == made
    assert json.loads((made.root / "home.json").read_text())["version"] == 1


def test_everything_lies_below_the_absolute_root(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    home = Home.open(Path("home"), create=True)
    paths = (home.lake, home.tracking_db, home.artifacts, home.models, home.reports)
    assert len(set(paths)) == 5
    assert all(path.is_relative_to(tmp_path / "home") for path in paths)


def test_reading_where_there_is_no_home_makes_nothing(tmp_path):
    with pytest.raises(
        HomeError, match=r"no LMTR home at .*missing; make one with `lmtr run demo`"
    ):
        Home.open(tmp_path / "missing", create=False)
    assert not (tmp_path / "missing").exists()


def test_an_empty_folder_is_taken_only_to_make_a_home(tmp_path):
    with pytest.raises(HomeError, match="no LMTR home"):
        Home.open(tmp_path, create=False)
    assert list(tmp_path.iterdir()) == []
    Home.open(tmp_path, create=True)
    assert (tmp_path / "home.json").is_file()


@pytest.mark.parametrize("create", [True, False])
def test_a_foreign_folder_is_never_claimed(tmp_path, create):
    (tmp_path / "thesis.tex").write_text("")
    with pytest.raises(HomeError, match=r"'thesis\.tex'.*choose an empty or a new folder"):
        Home.open(tmp_path, create=create)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_file_is_no_home(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(HomeError, match="is a file, not a folder"):
        Home.open(tmp_path / "file", create=True)


def test_a_folder_that_cannot_be_made_is_an_error_of_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(HomeError, match=r"cannot be opened: Not a directory; .*--home") as caught:
        Home.open(tmp_path / "file" / "home", create=True)
    assert "\n" not in str(caught.value)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_home_that_cannot_be_written_is_refused_for_writing_alone(tmp_path):
    home = Home.open(tmp_path / "home", create=True)
    home.root.chmod(0o500)
    assert Home.open(home.root, create=False) == home
    with pytest.raises(HomeError, match="Permission denied"):
        Home.open(home.root, create=True)


@pytest.mark.parametrize("marker", ["", "[1]", '{"application": "other", "version": 1}', "\udcff"])
def test_a_marker_of_something_else_is_refused(tmp_path, marker):
    (tmp_path / "home.json").write_bytes(marker.encode(errors="surrogateescape"))
    with pytest.raises(HomeError, match=r"home\.json is not LMTR's"):
        Home.open(tmp_path, create=True)


@pytest.mark.parametrize("version", [2, "1", None])
def test_a_newer_or_unknown_version_is_refused(tmp_path, version):
    (tmp_path / "home.json").write_text(json.dumps({"application": "lmtr", "version": version}))
    with pytest.raises(HomeError, match=f"of version {version}, this LMTR knows versions up to 1"):
        Home.open(tmp_path, create=False)


LOCK_HOLDER = """
import sys, time
from pathlib import Path
from services.home import Home
with Home.open(Path(sys.argv[1]), create=True).lock("generate-a"):
    print("held", flush=True)
    time.sleep(60)
"""


def test_a_lock_excludes_other_processes_until_its_holder_is_killed(tmp_path, spawn):
    home = Home.open(tmp_path / "home", create=True)
    holder = spawn(LOCK_HOLDER, home.root)
    assert holder.stdout.readline() == "held\n"
    with (
        pytest.raises(HomeError, match=f"process {holder.pid} is busy with 'generate-a'"),
        home.lock("generate-a"),
    ):
        pytest.fail("the lock was given twice")
    with home.lock("generate-b"):
        pass
    holder.kill()
    holder.communicate()
    with home.lock("generate-a"):
        pass
