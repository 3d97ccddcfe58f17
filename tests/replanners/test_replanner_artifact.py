"""A saved replanner plans as before, in a process that has nothing but its folder."""

import json
import subprocess
import sys

import numpy as np
import pytest

from lmtr.errors import ModelError
from lmtr.policies.distance import TaskWeights
from lmtr.replanners import artifact
from lmtr.replanners.build import build_replanner
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


def test_planning_needs_neither_torch_nor_services(models, walk_segments, tmp_path):
    artifact.save(tmp_path / "r", models[3], walk_segments, WEIGHTS, ANYMAL)
    code = (
        "import sys; from pathlib import Path; import numpy as np\n"
        "from lmtr.replanners import artifact\n"
        f"replanner = artifact.load(Path({str(tmp_path / 'r')!r}))\n"
        f"x = np.array({walk_segments.x[:2].tolist()!r})\n"
        "assert replanner.plan(x).shape == (2, 264)\n"
        "print(sorted({m.split('.')[0] for m in sys.modules} & "
        "{'torch', 'ray', 'mlflow', 'duckdb', 'deltalake', 'pyarrow', 'services', 'pipelines'}))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_damage_and_misfits_are_refused_by_name(models, walk_segments, tmp_path):
    folder = tmp_path / "r"
    artifact.save(folder, models[3], walk_segments, WEIGHTS, ANYMAL)
    with pytest.raises(ModelError, match="is there already"):
        artifact.save(folder, models[3], walk_segments, WEIGHTS, ANYMAL)
    with pytest.raises(ModelError, match="robot 'anymal', not 'hyq'"):
        artifact.save(tmp_path / "other", models[3], walk_segments, WEIGHTS, HYQ)
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
    (folder / artifact.DESCRIPTION).write_text(json.dumps(description | {"format": 2}))
    with pytest.raises(ModelError, match="must be of format 1, got 2"):
        artifact.load(folder)
    with pytest.raises(ModelError, match="name the folder of a saved replanner"):
        artifact.load(tmp_path / "nowhere")
    assert not list(tmp_path.glob(".*"))
