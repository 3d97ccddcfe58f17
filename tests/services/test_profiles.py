"""Profiles: what users may write in their settings file, and what they are told of a slip."""

from pathlib import Path

import pytest

from services.errors import ProfileError
from services.profiles import find_profile, load_settings, settings_file

FILE = """
profile = "local"

[profiles.local]
cluster = "http://127.0.0.1:8265/"
token_file = "~/ray_token"
tracking = "http://127.0.0.1:5000"
home = "/data/home"

[profiles.far]
cluster = "https://cluster.example"
home = "s3://bucket/lmtr"
"""


@pytest.fixture
def write(tmp_path):
    """Writes the settings file; returns an environment that names it."""

    def settings(text: str) -> dict[str, str]:
        (tmp_path / "settings.toml").write_text(text)
        return {"LMTR_SETTINGS": str(tmp_path / "settings.toml")}

    return settings


def test_a_profile_is_found_by_name_by_variable_and_by_default(write):
    environment = write(FILE)
    name, local = find_profile(None, environment)
    assert (name, local.cluster, local.home) == ("local", "http://127.0.0.1:8265", "/data/home")
    assert local.token_file == Path.home() / "ray_token"
    assert find_profile(None, {**environment, "LMTR_PROFILE": "far"})[0] == "far"
    name, far = find_profile("far", {**environment, "LMTR_PROFILE": "local"})
    assert (name, far.cluster, far.token_file) == ("far", "https://cluster.example", None)


def test_without_a_file_or_a_default_there_is_no_profile(write, tmp_path):
    assert find_profile(None, {"LMTR_SETTINGS": str(tmp_path / "none.toml")}) is None
    assert find_profile(None, write('[profiles.a]\ncluster = "http://a:1"')) is None


def test_the_file_lies_where_the_user_says(tmp_path):
    assert settings_file({"LMTR_SETTINGS": "/etc/mine.toml"}) == Path("/etc/mine.toml")
    named = settings_file({"XDG_CONFIG_HOME": str(tmp_path)})
    assert named == tmp_path / "lmtr" / "settings.toml"
    assert settings_file({}) == Path.home() / ".config" / "lmtr" / "settings.toml"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("profile = ", "no valid TOML"),
        ("profil = 'a'", "unknown key 'profil'; did you mean 'profile'?"),
        ("[profiles.a]", "profiles.a.cluster is missing; add it"),
        ("[profiles.a]\ncluster = 'http://a'\nhom = '/x'", "did you mean 'home'?"),
        ("[profiles.a]\ncluster = 'http://a'\nzzz = 1", "known: cluster, token_file"),
        ("[profiles.a]\ncluster = 'a:8265'", "profiles.a.cluster: must be an address like http"),
        ("[profiles.a]\ncluster = 'ray://a:10001'", "must be an address like http"),
        ("[profiles.a]\ncluster = 'http://u:p@a:1'", "no name or password"),
        ("[profiles.a]\ncluster = 'http://a:1/api'", "must end after the port"),
        ("[profiles.a]\ncluster = 'http://a:port'", "http://HOST:PORT"),
        ("[profiles.a]\ncluster = 7", "profiles.a.cluster: Input should be a valid string, got 7"),
        ("[profiles.a]\ncluster = 'http://a'\nhome = 'data'", "must be an absolute folder"),
        ("[profiles.a]\ncluster = 'http://a'\nhome = 's3://x'", "a bucket's name"),
        (
            "[profiles.a]\ncluster = 'http://a'\ntoken_file = 't'",
            "must be an absolute path",
        ),
        ("[profiles.a]\ncluster = 'http://a'\ntracking = 'sqlite:///x'", "profiles.a.tracking"),
    ],
)
def test_slips_are_told_with_the_file_and_the_key(write, text, said):
    environment = write(text)
    with pytest.raises(ProfileError) as caught:
        find_profile("a", environment)
    assert environment["LMTR_SETTINGS"] in str(caught.value)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_all_may_write_is_not_believed(write):
    file = settings_file(write('[profiles.a]\ncluster = "http://a:8265"\n'))
    file.chmod(0o666)
    with pytest.raises(ProfileError, match=r"; forbid it with `chmod o-w /.*`$"):
        load_settings(file)
    file.chmod(0o664)
    assert load_settings(file).profiles


def test_an_unknown_profile_is_told_with_those_there_are(write):
    with pytest.raises(ProfileError, match=r"'near' is not in .*; choose one of: local, far"):
        find_profile("near", write(FILE))
    with pytest.raises(ProfileError, match=r"write a table \[profiles.near\]"):
        find_profile("near", write(""))


def test_a_file_that_is_no_text_is_told(tmp_path):
    (tmp_path / "settings.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ProfileError, match="no UTF-8 text"):
        load_settings(tmp_path / "settings.toml")
    with pytest.raises(ProfileError, match="cannot be read"):
        load_settings(tmp_path)
