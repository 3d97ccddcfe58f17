"""A training can be repeated on the data that it had, after more came in."""

import shutil

import pytest

from services.home import Home
from services.lake.tables import Lake


def models(home):
    rows = Lake(Home.open(home, create=False).lake).read("models", order_by="created_at")
    return rows.to_pylist()


@pytest.fixture
def grown(lmtr, tmp_path, tiny_config):
    """A home in which a model was trained, and to which data were added then."""
    home = tmp_path / "home"
    for command in (["generate", "-n", 4], ["segment"], ["train", "-l", "0"]):
        assert lmtr(*command, "-c", tiny_config, "--home", home)[0] == 0
    for command in (["generate", "-n", 6], ["segment"]):
        assert lmtr(*command, "-c", tiny_config, "--home", home)[0] == 0
    return home


def test_the_same_version_gives_the_same_model(lmtr, grown, tiny_config):
    (first,) = models(grown)
    train = ("train", "-l", "0", "-c", tiny_config, "--home", grown)
    _, _, err = lmtr(*train, "--at", first["segments_version"])
    assert "all 1 models are there already" in err
    folder = grown / "models" / first["folder"]
    weights = {path.name: path.read_bytes() for path in folder.glob("*.safetensors")}
    assert weights
    shutil.rmtree(folder)
    assert lmtr(*train, "--at", first["segments_version"])[0] == 0
    again = {path.name: path.read_bytes() for path in folder.glob("*.safetensors")}
    assert again == weights
    assert lmtr(*train)[0] == 0
    assert models(grown)[-1]["model_id"] != first["model_id"]


def test_a_version_that_is_not_there_is_refused(lmtr, grown, tiny_config):
    train = ("train", "-l", "0", "-c", tiny_config, "--home", grown)
    status, _, err = lmtr(*train, "--at", 99)
    assert status == 2
    assert "table 'segments' has no version 99; choose one of 0 to" in err
    status, _, err = lmtr(*train, "--at", 0)
    assert status == 2
    assert "has no segments in version 0" in err
