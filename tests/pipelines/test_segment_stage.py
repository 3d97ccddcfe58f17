"""The stage that cuts: what lies in the lake is what the solutions say, obstacles included."""

import numpy as np
import pytest

from lmtr.geometry.se2 import SE2
from lmtr.robot.model import FEET
from lmtr.segmentation.window import cut
from lmtr.trajectory.sample import sample_base
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT
from lmtr.vectors.segment_vector import encode_segment
from lmtr.vectors.state import state_at
from lmtr.vectors.task_vector import encode_task, next_lines
from pipelines import records
from pipelines.workspace import Workspace

SINGLE = 1e-6
"""Least relative error (of numbers beyond 1, else absolute) that numbers of 32 bits keep to."""


@pytest.fixture(scope="module")
def lake(tiny_home):
    return Workspace.open(tiny_home, create=False).lake


@pytest.fixture(scope="module")
def solutions(lake):
    return {row["index"]: row for row in lake.read("solutions").to_pylist()}


@pytest.fixture(scope="module")
def segments(lake):
    return lake.read("segments", order_by="solution_index, epoch_s, goal_time_s").to_pylist()


def test_every_task_is_that_of_its_solution_obstacles_included(segments, solutions):
    lines_seen = set()
    for row in segments:
        solution = solutions[row["solution_index"]]
        trajectory, obstacles_W = records.trajectory_of(solution), records.obstacles_of(solution)
        assert len(obstacles_W) > 0
        reached = sample_base(trajectory, np.array([row["goal_time_s"]]))
        goal_W = np.array([*reached.position[0, :2], reached.rpy[0, 2]])
        expected = encode_task(state_at(trajectory, row["epoch_s"]), obstacles_W, goal_W)
        np.testing.assert_allclose(row["x"], expected, rtol=SINGLE, atol=SINGLE)
        lines_seen.add(tuple(np.round(TASK_LAYOUT.unpack(expected)["next_lines"][0], 6)))
    # Real lines were in sight, not the same dummy everywhere.
    assert len(lines_seen) > len(solutions)


def test_every_segment_is_that_window_of_its_solution(segments, solutions):
    for row in segments:
        trajectory = records.trajectory_of(solutions[row["solution_index"]])
        (expected,) = encode_segment(cut(trajectory, np.array([row["epoch_s"]])))
        np.testing.assert_allclose(row["tau"], expected, rtol=SINGLE, atol=SINGLE)


def test_only_accepted_solutions_are_cut_and_each_of_them(segments, solutions):
    accepted = {index for index, row in solutions.items() if row["accepted"]}
    assert {row["solution_index"] for row in segments} == accepted


def test_no_real_foothold_lies_as_far_ahead_as_the_dummy_of_a_missing_line(segments):
    nowhere = SE2.of([0.0, 0.0, 0.0])
    dummy = next_lines(np.zeros((0, 3)), nowhere)[0, 0]
    parts = SEGMENT_LAYOUT.unpack(np.array([row["tau"] for row in segments]))
    ahead = [
        parts[f"{foot}_{which}_foothold"][:, 0] for foot in FEET for which in ("first", "second")
    ]
    assert 0.5 < np.max(ahead) < dummy - 0.5
