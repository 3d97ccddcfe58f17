"""Every task becomes a row, whatever throws; robots are data."""

import numpy as np
import pytest

from lmtr.errors import DataError
from lmtr.expert.solve import Expert
from lmtr.robot.model import HYQ
from pipelines import generate as stage
from pipelines.config import load, parse
from pipelines.expert import build_expert
from pipelines.records import task_of
from services.home import Home
from services.lake.tables import Lake

SHORT = {
    "dataset": {"name": "short", "solutions": 4},
    "expert": {"scope": {"duration": 2.5, "n_swings": 2}},
    "tasks": {
        "goal_distance": [0.7, 0.9],
        "goal_lateral": 0.1,
        "first_obstacle": [0.4, 0.5],
        "obstacle_count": [1, 1],
    },
    "cluster": {"workers": 0},
}


@pytest.fixture
def rows(tmp_path):
    """Generates the short data set and gives its rows by index."""

    def make():
        home = Home.open(tmp_path / "home", create=True)
        stage.generate(parse(SHORT), stage.Workspace(home, parse(SHORT).cluster))
        return Lake(home.lake).read("solutions", order_by="index").to_pylist()

    return make


def test_what_throws_costs_one_row_and_names_its_task(rows, monkeypatch):
    solve, measure, calls = Expert.solve, stage.measure, iter(range(4))

    def unlucky_solve(self, task, noise):
        if next(calls) == 1:
            raise RuntimeError("out of\n luck")
        return solve(self, task, noise)

    def unlucky_measure(trajectory, robot, obstacles_W):
        if np.allclose(obstacles_W, third.obstacles_W):
            raise DataError("measure: no figures")
        return measure(trajectory, robot, obstacles_W)

    third, _ = stage.drawn(parse(SHORT), 2)
    monkeypatch.setattr(Expert, "solve", unlucky_solve)
    monkeypatch.setattr(stage, "measure", unlucky_measure)
    made = rows()
    assert [row["status"] for row in made] == ["converged", "error", "error", "converged"]
    assert [row["message"] for row in made[1:3]] == [
        "RuntimeError: out of luck",
        "DataError: measure: no figures",
    ]
    for index, row in enumerate(made):
        task, noise = stage.drawn(parse(SHORT), index)
        np.testing.assert_array_equal(task_of(row).goal_pose_W, task.goal_pose_W)
        np.testing.assert_array_equal(row["noise_timing"], noise.timing.ravel())
        assert row["accepted"] == (row["reject_reasons"] == [])
    assert made[1]["reject_reasons"] == ["not_converged:error"]


def test_a_draw_that_fails_is_a_row_too(rows, monkeypatch):
    monkeypatch.setattr(stage, "sample_noise", lambda *_: stage.Noise(np.full((3, 3), np.inf), 0))
    made = rows()
    assert [row["status"] for row in made] == ["error"] * 4
    assert made[0]["message"].startswith("TaskError: noise: amplitudes must be finite")
    assert made[0]["goal_pose"] is None


def test_the_folder_named_in_the_configuration_takes_the_compiled_expert(tmp_path, monkeypatch):
    folder = tmp_path / "chosen"
    config = parse({**SHORT, "cluster": {"cache": str(folder)}})
    monkeypatch.setattr(stage, "say", (said := []).append)
    for _ in range(2):
        stage._prepare_expert(config, build_expert)
    assert len(list(folder.glob("expert-*.so"))) == 1
    assert len(said) == 1
    assert "kept for all later runs" in said[0]
    folder.chmod(0o777)
    stage._prepare_expert(config, build_expert)
    assert "interpreted" in said[1]
    assert f"chmod go-w {folder}" in said[1]


def test_hosts_of_a_cluster_compile_for_themselves_and_tell_of_it(tmp_path, caplog):
    folder = tmp_path / "chosen"
    config = parse({**SHORT, "cluster": {"cache": str(folder), "address": "auto"}})
    stage._prepare_expert(config, build_expert)
    assert not folder.exists()
    stage.SolveWorker(config)
    stage.SolveWorker(config)
    assert len(list(folder.glob("expert-*.so"))) == 1
    (told,) = caplog.messages
    assert "kept for all later runs" in told


PHYSICAL = {
    "linear_residual_peak": 1.0,
    "angular_residual_peak": 5.0,
    "drift": 0.015,
    "stance_overshoot": 0.02,
    "swing_overshoot": 0.03,
    "friction_excess": 0.01,
    "pull": 0.01,
    "stance_slip": 1e-3,
    "flight_time": 0.01,
    "force_peak": 1.5,
    "tilt": 0.3,
}
"""What no walk of any robot may exceed, whatever the thresholds of the filter are tuned to."""


@pytest.mark.slow
def test_another_robot_is_solved_by_changing_one_file():
    """Eight tasks of the built-in HyQ file."""
    config = load("hyq")
    assert config.dataset.robot == HYQ
    worker = stage.SolveWorker(config)
    made = [worker(index)[0] for index in range(8)]
    assert sum(row["status"] == "converged" for row in made) >= 7
    assert sum(within(dict(row["violations"])) for row in made) >= 7
    assert sum(row["accepted"] for row in made) > 4
    assert {row["expected_cost"] for row in made} == {None}


def within(violations):
    return all(violations[name] <= limit for name, limit in PHYSICAL.items())
