"""Model folders: round trip, refusals by name, damage, replacement."""

import dataclasses
import hashlib
import json
import os
import pickle
from itertools import count
from pathlib import Path

import numpy as np
import pytest
import torch

from lmtr.errors import ModelError
from lmtr.models.checkpoint import DESCRIPTION, WEIGHTS, load, save
from lmtr.robot.model import ANYMAL, HYQ
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT


@pytest.fixture
def folder(tmp_path, small_model):
    save(small_model(3), tmp_path / "models" / "one")
    return tmp_path / "models" / "one"


@pytest.mark.parametrize("latent", [0, 3])
def test_a_loaded_model_is_the_saved_one(tmp_path, small_model, walk_segments, latent):
    model = small_model(latent)
    save(model, tmp_path / "model")
    loaded = load(tmp_path / "model", robot=ANYMAL)
    x, tau = walk_segments.x, walk_segments.tau
    mu, sigma = model.encode(tau, x)
    np.testing.assert_array_equal(loaded.encode(tau, x), (mu, sigma))
    np.testing.assert_array_equal(loaded.predict(x, mu), model.predict(x, mu))
    for name in ("settings", "training", "robot", "history", "provenance"):
        assert getattr(loaded, name) == getattr(model, name)
    assert sorted(p.name for p in (tmp_path / "model").iterdir()) == [DESCRIPTION, WEIGHTS]
    assert [p.name for p in tmp_path.iterdir()] == ["model"]


def test_another_layout_is_refused_by_name(folder):
    other = dataclasses.replace(TASK_LAYOUT, fields=TASK_LAYOUT.fields[:-1])
    with pytest.raises(ModelError, match=r"its task layout does not fit: .*'task' version 1"):
        load(folder, task_layout=other)
    renamed = dataclasses.replace(SEGMENT_LAYOUT.fields[3], name="LF_swing_apex")
    fields = (*SEGMENT_LAYOUT.fields[:3], renamed, *SEGMENT_LAYOUT.fields[4:])
    with pytest.raises(ModelError, match=r"segment layout .*LF_swing_apex"):
        load(folder, segment_layout=dataclasses.replace(SEGMENT_LAYOUT, fields=fields))


def test_another_robot_is_refused_with_what_differs(folder):
    with pytest.raises(ModelError, match=r"'hyq', got 'anymal', .*mass"):
        load(folder, robot=HYQ)
    slippery = ANYMAL.model_copy(update={"friction": 0.4})
    with pytest.raises(ModelError, match=r"differs in friction \(friction: 0.4 against 0.7\)"):
        load(folder, robot=slippery)


@pytest.mark.parametrize("kept", [0, 5, 100, -1])
def test_truncated_weights_are_refused(folder, kept):
    whole = (folder / WEIGHTS).read_bytes()
    (folder / WEIGHTS).write_bytes(whole[:kept])
    with pytest.raises(ModelError, match=WEIGHTS):
        load(folder)


def test_a_changed_number_is_refused(folder):
    content = bytearray((folder / WEIGHTS).read_bytes())
    content[-20] ^= 1
    (folder / WEIGHTS).write_bytes(bytes(content))
    with pytest.raises(ModelError, match="SHA-256 differs"):
        load(folder)


class Payload:
    """Leaves a file where it is unpickled."""

    def __init__(self, mark):
        self._mark = mark

    def __reduce__(self):
        return (Path.touch, (self._mark,))


@pytest.mark.parametrize("dump", [pickle.dump, torch.save])
def test_a_pickle_in_the_place_of_weights_is_refused_and_not_run(folder, tmp_path, dump):
    mark = tmp_path / "was run"
    with (folder / WEIGHTS).open("wb") as file:
        dump(Payload(mark), file)
    digest = hashlib.sha256((folder / WEIGHTS).read_bytes()).hexdigest()
    description = json.loads((folder / DESCRIPTION).read_text()) | {"weights_sha256": digest}
    (folder / DESCRIPTION).write_text(json.dumps(description))
    with pytest.raises(ModelError, match=WEIGHTS):
        load(folder)
    assert not mark.exists()
    with (folder / WEIGHTS).open("rb") as file:  # the payload works where pickles are trusted
        pickle.load(file) if dump is pickle.dump else torch.load(file, weights_only=False)
    assert mark.exists()


@pytest.mark.parametrize("name", [WEIGHTS, DESCRIPTION])
def test_a_missing_file_is_named(folder, name):
    (folder / name).unlink()
    with pytest.raises(ModelError, match=name):
        load(folder)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.update(format=99), "format 2, got 99"),
        (lambda d: d["layouts"].pop("segment"), "segment"),
        (lambda d: d["settings"].update(hidden=[16, 25]), "layer 1 of the encoder|layer 0"),
        (lambda d: d["settings"].update(kappa=-1.0), "kappa"),
        (lambda d: d.pop("history"), "history"),
    ],
)
def test_a_description_that_makes_no_model_is_refused(folder, change, message):
    description = json.loads((folder / DESCRIPTION).read_text())
    change(description)
    (folder / DESCRIPTION).write_text(json.dumps(description))
    with pytest.raises(ModelError, match=message):
        load(folder)


def test_a_description_cut_short_is_refused(folder):
    (folder / DESCRIPTION).write_bytes((folder / DESCRIPTION).read_bytes()[:300])
    with pytest.raises(ModelError, match=f"{DESCRIPTION} is damaged"):
        load(folder)


def test_an_older_model_is_replaced_and_other_files_are_not(folder, small_model, tmp_path):
    save(small_model(0), folder)
    assert load(folder).latent == 0
    (folder / "notes.txt").write_text("mine")
    with pytest.raises(ModelError, match="other files"):
        save(small_model(3), folder)
    assert (folder / "notes.txt").read_text() == "mine"
    (tmp_path / "file").write_text("mine")
    with pytest.raises(ModelError, match="other files"):
        save(small_model(3), tmp_path / "file")


def test_a_save_that_fails_half_way_leaves_the_old_model(folder, small_model, monkeypatch):
    files = count()

    def full_disk(_):
        if next(files) % 2:  # every second file
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(OSError, match="No space"):
        save(small_model(0), folder)
    with pytest.raises(OSError, match="No space"):
        save(small_model(0), folder.parent / "two")
    assert load(folder).latent == 3
    assert [p.name for p in folder.parent.iterdir()] == ["one"]
