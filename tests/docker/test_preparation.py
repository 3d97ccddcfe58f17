"""What the cluster's first start leaves on the user's disk."""

import os
import stat
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from preparation import MADE, STORAGE, container_user, make_secrets, secrets_state, use_storage
from user_profile import settings_file, write_profile

ROOT = Path(__file__).resolve().parents[2]
VALUES = {"cluster": "http://127.0.0.1:8265", "token_file": '/a "quoted" \\ folder/token'}


@pytest.fixture
def folder(tmp_path):
    made = tmp_path / "secrets"
    previous = os.umask(0)  # the least careful of users
    try:
        make_secrets(made, container_user())
    finally:
        os.umask(previous)
    return made


def secrets_of(folder):
    """Its files, but for the one that keeps Git out."""
    return [file for file in folder.iterdir() if file.name != ".gitignore"]


def test_nobody_else_reads_a_secret(folder):
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    files = sorted(secrets_of(folder))
    assert [file.name for file in files] == sorted([*MADE, STORAGE])
    assert {stat.S_IMODE(file.stat().st_mode) for file in files} == {0o600}
    assert {file.stat().st_uid for file in files} == {container_user()}


def test_secrets_are_long_and_differ(folder, tmp_path):
    make_secrets(tmp_path / "others", container_user())
    both = [
        (place / name).read_text().strip() for place in folder.parent.iterdir() for name in MADE
    ]
    assert len(set(both)) == 2 * len(MADE)
    assert {len(bytes.fromhex(secret)) for secret in both} == {32}


def test_a_second_start_keeps_them(folder):
    before = {file.name: file.read_bytes() for file in secrets_of(folder)}
    state = secrets_state(folder)
    make_secrets(folder, container_user())
    assert {file.name: file.read_bytes() for file in secrets_of(folder)} == before
    assert secrets_state(folder) == state


def key_of(folder):
    lines = (folder / STORAGE).read_text().splitlines()
    return dict(line.split("=", 1) for line in lines).get("AWS_SECRET_ACCESS_KEY")


def test_object_storage_is_reached_by_its_password_also_by_a_new_one(folder):
    for _ in range(2):
        use_storage(folder, wanted=True)
        assert key_of(folder) == (folder / "storage_password").read_text().strip()
        (folder / "storage_password").unlink()
        make_secrets(folder, container_user())
    use_storage(folder, wanted=False)
    assert key_of(folder) is None


def test_nothing_is_written_again_that_is_right_already(folder):
    use_storage(folder, wanted=True)
    state = secrets_state(folder)
    use_storage(folder, wanted=True)
    assert secrets_state(folder) == state


@pytest.mark.parametrize("wanted", [True, False])
def test_storage_of_the_users_own_is_kept(folder, wanted):
    (folder / STORAGE).write_text("AWS_ENDPOINT_URL=https://store.example\n")
    use_storage(folder, wanted)
    assert (folder / STORAGE).read_text() == "AWS_ENDPOINT_URL=https://store.example\n"


def test_a_removed_secret_is_made_anew(folder):
    before = (folder / "ray_token").read_text()
    (folder / "ray_token").unlink()
    make_secrets(folder, container_user())
    assert (folder / "ray_token").read_text() != before


@pytest.mark.parametrize("name", [*MADE, STORAGE])
def test_a_secret_that_was_written_again_is_seen(folder, name):
    state = secrets_state(folder)
    (folder / name).write_text("another")
    assert secrets_state(folder) != state


def test_where_users_are_mapped_the_group_reads_them_and_nobody_gets_to_them(folder):
    make_secrets(folder, container_user(), 0o640)
    assert {stat.S_IMODE(file.stat().st_mode) for file in secrets_of(folder)} == {0o640}
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    make_secrets(folder, container_user())
    assert {stat.S_IMODE(file.stat().st_mode) for file in secrets_of(folder)} == {0o600}


def test_containers_are_the_user_s_also_by_sudo_and_never_root_s(monkeypatch):
    monkeypatch.delenv("SUDO_UID", raising=False)
    assert container_user() == (os.getuid() or 10001)
    monkeypatch.setattr(os, "getuid", lambda: 0)
    monkeypatch.setenv("SUDO_UID", "1234")
    assert container_user() == 1234
    monkeypatch.setenv("SUDO_UID", "0")
    assert container_user() == 10001


def test_git_sees_no_secret_wherever_they_are(folder):
    subprocess.run(["git", "init", "--quiet", folder.parent], check=True)
    told = ["git", "-C", str(folder.parent), "status", "--porcelain", "--untracked-files=all"]
    assert subprocess.run(told, capture_output=True, text=True, check=True).stdout == ""


def test_git_sees_no_secret():
    paths = ["docker/secrets/ray_token", "docker/.env"]
    paths += ["docker/secrets-second/ray_token", "docker/.env.second"]
    said = subprocess.run(
        ["git", "-C", str(ROOT), "check-ignore", *paths],
        capture_output=True,
        text=True,
        check=False,
    )
    assert said.stdout.split() == paths


def test_a_profile_in_a_new_file_is_the_default(tmp_path):
    file = tmp_path / "settings" / "settings.toml"
    assert write_profile(file, VALUES)
    assert tomllib.loads(file.read_text()) == {"profile": "local", "profiles": {"local": VALUES}}


def test_a_profile_leaves_the_rest_of_the_file_alone(tmp_path):
    file = tmp_path / "settings.toml"
    others = '# mine\nprofile = "far"\n\n[profiles.far] # away\ncluster = "http://far:8265"\n'
    file.write_text(f'{others}\n[profiles.local]\ncluster = "http://old:1"\nhome = "/gone"\n')
    assert not write_profile(file, VALUES)
    assert file.read_text().startswith(others)
    assert tomllib.loads(file.read_text())["profiles"]["local"] == VALUES
    once = file.read_text()
    assert not write_profile(file, VALUES)
    assert file.read_text() == once


def test_a_broken_file_is_not_written_to(tmp_path):
    file = tmp_path / "settings.toml"
    file.write_text("profile = \n")
    with pytest.raises(ValueError, match="no valid TOML"):
        write_profile(file, VALUES)
    assert file.read_text() == "profile = \n"


def test_the_settings_file_is_where_lmtr_looks(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    monkeypatch.delenv("LMTR_SETTINGS", raising=False)
    assert settings_file() == tmp_path / "lmtr" / "settings.toml"
    monkeypatch.setenv("LMTR_SETTINGS", str(tmp_path / "mine.toml"))
    assert settings_file() == tmp_path / "mine.toml"


def test_an_impossible_cluster_is_refused_in_one_line():
    command = [sys.executable, str(ROOT / "docker" / "cluster.py"), "up", "--workers", "0"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == (
        "cluster: LMTR_WORKERS=0: a cluster needs at least one worker with one processor\n"
    )
