"""`lmtr export replanner`: a folder that plans as the home's own replanner does."""

import re

import numpy as np
import pytest

from lmtr.policies.distance import TaskWeights
from lmtr.replanners import artifact
from lmtr.replanners.build import build_replanner
from lmtr.robot.model import ANYMAL
from pipelines.config import load as configuration
from pipelines.learning_data import learning_data
from pipelines.registry import load
from pipelines.workspace import Workspace


@pytest.fixture(scope="module")
def space(tiny_home):
    return Workspace.open(tiny_home, create=False)


@pytest.fixture(scope="module")
def models(space):
    """Ids of the home's models by latent dimension."""
    rows = space.lake.read("models", ["latent", "model_id"]).to_pylist()
    return {row["latent"]: row["model_id"] for row in rows}


@pytest.fixture(scope="module")
def data(space, tiny_config):
    (dataset_id,) = space.lake.values("datasets", "dataset_id")
    return learning_data(configuration(str(tiny_config)), space, dataset_id)


@pytest.mark.parametrize("source", ["model", "library"])
@pytest.mark.parametrize("policy", ["nearest", "selected"])
def test_an_exported_replanner_plans_like_the_homes_own(
    lmtr, space, models, data, tiny_home, tmp_path, source, policy
):
    out, name = tmp_path / "r", models[2] if source == "model" else "library"
    status, said, err = lmtr(
        "export", "replanner", name, "--out", out, "--policy", policy, "--weights", "1,1,5,0.5",
        "--set", "evaluation.selection.candidates=3", "--home", tiny_home,
    )  # fmt: skip
    assert status == 0, err
    assert re.search(r"one plan: \d+\.\d\d ms \(median\), \d+\.\d\d ms \(p99\)", said)
    selection = configuration(None, ["evaluation.selection.candidates=3"]).evaluation.selection
    own = build_replanner(
        load(space, name) if source == "model" else None,
        data.training,
        TaskWeights.of([1.0, 1.0, 5.0, 0.5]),
        selection=selection if policy == "selected" else None,
        robot=ANYMAL,
    )
    x = data.validation.x
    np.testing.assert_allclose(artifact.load(out).plan(x), own.plan(x), rtol=1e-5, atol=1e-4)
    made = artifact.provenance(out)
    assert made["model_id"] == (name if source == "model" else None)
    assert made["dataset_id"] == data.dataset_id
    assert made["segments_version"] == data.version
    assert made["library_rows"] == len(data.training.x)


def test_the_snippet_it_prints_runs(lmtr, models, data, tiny_home, tmp_path):
    out = tmp_path / "r"
    status, said, err = lmtr(
        "export", "replanner", models[2], "--out", out, "--rows", 20, "--home", tiny_home
    )
    assert status == 0, err
    assert "20 segments to look up" in said
    snippet = said[said.index("from pathlib") :]
    names = {"x": data.validation.x[:1]}
    exec(snippet, names)
    assert names["tau"].shape == (1, 264)


@pytest.mark.parametrize("policy", ["gaussian", "zero"])
def test_policies_that_look_nothing_up_leave_the_library_out(
    lmtr, models, data, tiny_home, tmp_path, policy
):
    out = tmp_path / "r"
    status, said, err = lmtr(
        "export", "replanner", models[2], "-o", out, "--policy", policy, "--home", tiny_home
    )
    assert status == 0, err
    assert "look up" not in said
    assert artifact.load(out).name == f"LMTR-2 ({policy})"
    assert artifact.load(out).plan(data.validation.x).shape == data.validation.tau.shape


def test_bad_input_is_one_line_and_leaves_nothing(lmtr, models, tiny_home, tmp_path):
    unknown = models[2][:-1] + "?"
    cases = (
        ([unknown], [repr(unknown), "is not in this home", models[2]]),
        (["library", "--policy", "gaussian"], ["no policy 'gaussian'", "nearest, selected"]),
        ([models[0], "--policy", "zero"], ["no policy 'zero'", "nearest"]),
        ([models[2], "--weights", "1,2"], ["must be 4 numbers", "got 2"]),
        ([models[2], "--weights", "1,1,-1,1"], ["--weights", "at least 0"]),
        ([models[2], "--dataset", "another"], ["not 'another'", "leave --dataset out"]),
    )
    for arguments, words in cases:
        command = ("export", "replanner", *arguments, "-o", tmp_path / "r", "--home", tiny_home)
        status, _, err = lmtr(*command)
        assert status == 2
        assert err.count("\n") == 1
        for word in words:
            assert word in err
    (tmp_path / "there").mkdir()
    command = ("export", "replanner", models[2], "-o", tmp_path / "there", "--home", tiny_home)
    status, _, err = lmtr(*command)
    assert status == 2
    assert "is there already" in err
    assert [path.name for path in tmp_path.iterdir()] == ["there"]
