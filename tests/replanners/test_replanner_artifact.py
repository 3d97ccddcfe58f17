"""A saved replanner plans as before, in a process that has nothing but its folder."""

import hashlib
import importlib
import json
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lmtr.errors import ModelError
from lmtr.models.mode_regressor import fit_mode_regressor
from lmtr.models.settings import ModeRegressorSettings
from lmtr.policies.distance import TaskWeights
from lmtr.policies.gaussian_policy import GaussianModePolicy
from lmtr.policies.mode_policy import ZeroModePolicy
from lmtr.replanners import artifact
from lmtr.replanners.build import build_replanner
from lmtr.replanners.latent_mode import LatentModeReplanner
from lmtr.replanners.selecting import Selection
from lmtr.robot.model import ANYMAL, HYQ

WEIGHTS = TaskWeights(eta=5.0)


@pytest.mark.parametrize("latent", [0, 3, None])
@pytest.mark.parametrize("selection", [None, Selection(candidates=3)])
def test_plans_are_the_same_to_single_precision(models, walk_segments, tmp_path, latent, selection):
    model = None if latent is None else models[latent]
    if latent == 0 and selection is not None:
        pytest.skip("there is nothing to select from")
    before = build_replanner(model, walk_segments, WEIGHTS, selection=selection, robot=ANYMAL)
    artifact.save(tmp_path / "r", model, walk_segments, WEIGHTS, ANYMAL, selection=selection)
    after = artifact.load(tmp_path / "r", robot=ANYMAL)
    np.testing.assert_allclose(
        after.plan(walk_segments.x), before.plan(walk_segments.x), rtol=1e-5, atol=1e-4
    )
    assert after.name == before.name
    assert after.describe() == before.describe()


def gaussian(model, walk_segments):
    network = fit_mode_regressor(model, walk_segments, ModeRegressorSettings(epochs=2))
    return GaussianModePolicy(network, model.task_scaling)


@pytest.mark.parametrize("kind", ["gaussian", "zero"])
def test_policies_that_look_nothing_up_are_kept_without_a_library(
    models, walk_segments, tmp_path, kind
):
    model = models[3]
    policy = gaussian(model, walk_segments) if kind == "gaussian" else ZeroModePolicy(3)
    before = LatentModeReplanner(model, policy)
    artifact.save(tmp_path / "r", model, walk_segments, WEIGHTS, ANYMAL, policy=policy)
    after = artifact.load(tmp_path / "r")
    np.testing.assert_allclose(
        after.plan(walk_segments.x), before.plan(walk_segments.x), rtol=1e-9, atol=1e-9
    )
    assert after.describe() == before.describe()
    few = type(walk_segments)(walk_segments.x[:2], walk_segments.tau[:2])
    artifact.save(tmp_path / "few", model, few, WEIGHTS, ANYMAL, policy=policy)
    sizes = [(tmp_path / name / artifact.LIBRARY).stat().st_size for name in ("r", "few")]
    assert sizes[0] == sizes[1]


def test_what_made_a_replanner_is_kept_beside_it(models, walk_segments, tmp_path):
    made = {"model_id": "LMTR-3-1", "code_version": "1.0", "config": {"seed": 3}}
    artifact.save(tmp_path / "r", None, walk_segments, WEIGHTS, ANYMAL, provenance=made)
    found = artifact.provenance(tmp_path / "r")
    assert {name: found[name] for name in made} == made
    assert len(found["library_sha256"]) == 64


BLOCKED = (
    "torch", "ray", "mlflow", "duckdb", "deltalake", "pyarrow", "casadi", "scipy", "services",
    "pipelines",
)  # fmt: skip

ALONE = """
import sys
from pathlib import Path
from importlib.abc import MetaPathFinder
from pathlib import Path

class Blocking(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in BLOCKED:
            raise ImportError(f"{name} is blocked")

sys.meta_path.insert(0, Blocking())
import numpy as np
from lmtr.replanners import artifact

folder = Path(sys.argv[1])
np.save(folder / "plans.npy", artifact.load(folder / "r").plan(np.load(folder / "x.npy")))
"""


@pytest.mark.parametrize("kind", ["nearest", "selected", "gaussian"])
def test_a_process_that_has_nothing_but_numpy_makes_the_same_plans(
    models, walk_segments, tmp_path, kind
):
    model = models[3]
    artifact.save(
        tmp_path / "r",
        model,
        walk_segments,
        WEIGHTS,
        ANYMAL,
        policy=gaussian(model, walk_segments) if kind == "gaussian" else None,
        selection=Selection(candidates=3) if kind == "selected" else None,
    )
    np.save(tmp_path / "x.npy", walk_segments.x)
    code = ALONE.replace("BLOCKED", repr(BLOCKED))
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=True)
    expected = artifact.load(tmp_path / "r").plan(walk_segments.x)
    np.testing.assert_array_equal(np.load(tmp_path / "plans.npy"), expected)


def test_damage_and_misfits_are_refused_by_name(models, walk_segments, tmp_path):
    folder = tmp_path / "r"
    artifact.save(folder, models[3], walk_segments, WEIGHTS, ANYMAL)
    with pytest.raises(ModelError, match="is there already"):
        artifact.save(folder, models[3], walk_segments, WEIGHTS, ANYMAL)
    with pytest.raises(ModelError, match="robot 'anymal', not 'hyq'"):
        artifact.save(tmp_path / "other", models[3], walk_segments, WEIGHTS, HYQ)
    for model in (models[0], None):
        with pytest.raises(ModelError, match="leave the policy out"):
            artifact.save(
                tmp_path / "p", model, walk_segments, WEIGHTS, ANYMAL, policy=ZeroModePolicy(3)
            )
    with pytest.raises(ModelError, match="must be of robot 'hyq', got 'anymal'"):
        artifact.load(folder, robot=HYQ)
    path = folder / artifact.LIBRARY
    content = path.read_bytes()
    path.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    with pytest.raises(ModelError, match="is not the file"):
        artifact.load(folder)
    path.unlink()
    with pytest.raises(ModelError, match="missing or damaged"):
        artifact.load(folder)
    description = json.loads((folder / artifact.DESCRIPTION).read_text())
    (folder / artifact.DESCRIPTION).write_text(json.dumps(description | {"format": 3}))
    with pytest.raises(ModelError, match="must be of format 2, got 3"):
        artifact.load(folder)
    with pytest.raises(ModelError, match="name the folder of a saved replanner"):
        artifact.load(tmp_path / "nowhere")
    assert not list(tmp_path.glob(".*"))


def test_a_pickle_among_its_files_is_refused_and_not_run(models, walk_segments, tmp_path):
    folder, mark = tmp_path / "r", tmp_path / "was run"
    artifact.save(folder, models[3], walk_segments, WEIGHTS, ANYMAL)
    evil = pickle.dumps(Evil(mark))
    (folder / artifact.LIBRARY).write_bytes(evil)
    description = json.loads((folder / artifact.DESCRIPTION).read_text())
    description["library_sha256"] = hashlib.sha256(evil).hexdigest()
    (folder / artifact.DESCRIPTION).write_text(json.dumps(description))
    (folder / "python_model.pkl").write_bytes(evil)
    with pytest.raises(ModelError, match=artifact.LIBRARY):
        artifact.load(folder)
    assert not mark.exists()
    pickle.loads(evil)
    assert mark.exists()


def test_what_mlflow_puts_beside_it_is_neither_run_nor_minded(
    models, walk_segments, tmp_path, monkeypatch
):
    folder, mark = tmp_path / "r", tmp_path / "was run"
    artifact.save(folder, models[3], walk_segments, WEIGHTS, ANYMAL)
    (tmp_path / "evil_loader.py").write_text(f"open({str(mark)!r}, 'w')\n")
    monkeypatch.syspath_prepend(tmp_path)
    evil = pickle.dumps(Evil(mark))
    for place in (folder, folder / artifact.MODEL):
        (place / "MLmodel").write_text(
            "flavors:\n  python_function:\n    loader_module: evil_loader\n"
            "    python_model: python_model.pkl\n"
        )
        for name in ("python_model.pkl", "weights.pt", "model.pkl"):
            (place / name).write_bytes(evil)
        (place / "__init__.py").write_text("import evil_loader\n")
    plans = artifact.load(folder).plan(walk_segments.x[:2])
    assert np.isfinite(plans).all()
    assert not mark.exists()
    importlib.import_module("evil_loader")
    assert mark.exists()


class Evil:
    """Leaves a file where it is unpickled."""

    def __init__(self, mark):
        self._mark = mark

    def __reduce__(self):
        return (Path.touch, (self._mark,))
