"""The expert as the line of reference, solved on the reported courses."""

import shutil

import pytest

from lmtr.errors import ConfigurationError
from lmtr.rollout.courses import random_course
from lmtr.rollout.settings import RolloutSettings
from lmtr.rollout.tally import NAMES
from pipelines.config import load
from services.home import Home
from services.lake.tables import Lake

SETS = ("--set", "evaluation.expert_courses=1")


@pytest.mark.slow
def test_the_expert_walks_the_courses_once(lmtr, tiny_home, tiny_config, tmp_path):
    home = tmp_path / "home"
    shutil.copytree(tiny_home, home)
    status, _, err = lmtr("evaluate", "-c", tiny_config, *SETS, "--home", home)
    assert status == 0, err
    lake = Lake(Home.open(home, create=False).lake)
    (row,) = lake.read("evaluations", where="policy = 'expert'").to_pylist()
    assert (row["replanner"], row["weights"], row["purpose"]) == ("expert", [], "report")
    assert (row["latent"], row["model_id"], row["seed"]) == (None, None, 0)
    (walk,) = lake.read("rollouts", where="replanner = 'expert'").to_pylist()
    course = random_course(RolloutSettings(duration=3.0), 0, 0)
    assert walk["obstacles"] == course.obstacles_W.ravel().tolist()
    sums, summary = dict(walk["metrics"]), dict(row["summary"])
    assert set(sums) == set(NAMES)
    assert (walk["outcome"], sums["falls"], summary["diverged"]) == ("completed", 0.0, 0.0)
    assert sums["crossed"] == summary["obstacles_crossed"] >= 1.0
    assert len(walk["clearances"]) == sums["steps"]
    assert summary["close_share"] == 0.0
    assert 0.0 < summary["linear_residual"] < summary["linear_residual_p95"] < 1.0
    assert 0.0 < summary["angular_residual"] < summary["angular_residual_p95"] < 4.0
    assert summary["pull_share"] == 0.0
    status, _, err = lmtr("lake", "check", "--home", home)
    assert status == 0, err

    before = {name: lake.version(name) for name in lake.tables()}
    assert lmtr("evaluate", "-c", tiny_config, *SETS, "--home", home)[0] == 0
    assert {name: lake.version(name) for name in lake.tables()} == before
    # A report compares replanners; the expert's line is drawn apart.
    assert lmtr("report", "-c", tiny_config, "--home", home)[0] == 0


def test_more_courses_than_there_are_is_refused():
    with pytest.raises(ConfigurationError, match="must not exceed the 5 rollouts, got 6"):
        load(None, ["evaluation.rollouts=5", "evaluation.expert_courses=6"])
