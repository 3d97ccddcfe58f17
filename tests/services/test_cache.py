"""Where the machine's cache lies: as named, else where its user can write."""

import os
import tempfile
from pathlib import Path

import pytest

from services.cache import machine_cache


@pytest.fixture
def user(tmp_path, monkeypatch):
    """A user with a home and nothing else, on a machine with a folder for temporary files."""
    home, temporary = tmp_path / "user", tmp_path / "temporary"
    home.mkdir()
    temporary.mkdir()
    for name in ("LMTR_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    return home


def test_it_lies_with_the_users_caches_and_is_not_made_by_asking(user):
    assert machine_cache() == user / ".cache" / "lmtr"
    assert list(user.iterdir()) == []


def test_what_is_named_goes_before_the_environment_and_that_before_the_usual(user, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(user / "caches"))
    assert machine_cache() == user / "caches" / "lmtr"
    monkeypatch.setenv("LMTR_CACHE", "~/mine")
    assert machine_cache() == user / "mine"
    assert machine_cache(Path("/srv/lmtr")) == Path("/srv/lmtr")


def test_a_relative_folder_of_caches_is_ignored_and_a_relative_name_made_absolute(
    user, monkeypatch
):
    monkeypatch.chdir(user)
    monkeypatch.setenv("XDG_CACHE_HOME", "caches")
    assert machine_cache() == user / ".cache" / "lmtr"
    monkeypatch.setenv("LMTR_CACHE", "mine")
    assert machine_cache() == user / "mine"


def test_an_empty_variable_names_nothing(user, monkeypatch):
    monkeypatch.setenv("LMTR_CACHE", "")
    assert machine_cache() == user / ".cache" / "lmtr"


def test_a_user_without_a_writable_home_gets_a_temporary_folder(user, monkeypatch):
    (user / ".cache").write_text("no folder")
    expected = Path(tempfile.gettempdir()) / f"lmtr-{os.geteuid()}"
    assert machine_cache() == expected
    assert not expected.exists()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_may_not_be_written_is_passed_by(user):
    user.chmod(0o500)
    try:
        assert machine_cache().parent == Path(tempfile.gettempdir())
    finally:
        user.chmod(0o700)
