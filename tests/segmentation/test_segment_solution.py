"""Rows (x, τ) of a solution: traceable, within their rules, reproducible."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from lmtr.segmentation.segment import SegmentationSettings, segment_solution
from lmtr.segmentation.window import cut, valid_epochs
from lmtr.streams import Purpose, stream
from lmtr.trajectory.sample import sample_base
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT
from lmtr.vectors.segment_vector import encode_segment
from lmtr.vectors.state import state_at
from lmtr.vectors.task_vector import encode_task

SETTINGS = SegmentationSettings(epochs_per_solution=12, goals_per_epoch=3)


def segments_of(example, settings=SETTINGS, index=0):
    return segment_solution(
        example.trajectory, example.task.obstacles_W, settings, stream(7, Purpose.SEGMENTS, index)
    )


def test_each_row_can_be_traced_to_its_epoch_and_goal(walk):
    example = walk(1)
    rows = segments_of(example)
    assert rows.x.shape == (36, TASK_LAYOUT.size)
    assert rows.tau.shape == (36, SEGMENT_LAYOUT.size)
    trajectory = example.trajectory
    for row in (0, 7, 20, 35):
        epoch = rows.epoch_s[row]
        tau = encode_segment(cut(trajectory, np.array([epoch])))[0]
        assert np.array_equal(rows.tau[row], tau)
        base = sample_base(trajectory, rows.goal_time_s[[row]])
        goal = np.array([*base.position[0, :2], base.rpy[0, 2]])
        x = encode_task(state_at(trajectory, float(epoch)), example.task.obstacles_W, goal)
        assert rows.x[row] == pytest.approx(x, abs=1e-12)


def test_segment_and_task_tell_of_the_same_state(walk):
    rows = segments_of(walk(2))
    x, tau = TASK_LAYOUT.unpack(rows.x), SEGMENT_LAYOUT.unpack(rows.tau)
    assert x["height"] == pytest.approx(tau["base_nodes"][:, 0, 0, 2], abs=1e-12)
    assert x["roll_pitch"] == pytest.approx(tau["base_nodes"][:, 0, 0, 3:5], abs=1e-12)
    # Between knots the first node's slope is fitted too.
    assert x["linear_velocity"] == pytest.approx(tau["base_nodes"][:, 0, 1, :3], abs=1e-2)
    stands = tau["LF_times"][:, 1] > 0.0
    assert stands.any()
    assert x["LF_position"][stands] == pytest.approx(tau["LF_first_foothold"][stands], abs=1e-9)


def test_epochs_are_valid_and_lie_anywhere_between_the_nodes(walk):
    rows = segments_of(walk(3))
    assert valid_epochs(walk(3).trajectory, rows.epoch_s).all()
    assert len(np.unique(rows.epoch_s)) == 12
    off_knots = np.abs(rows.epoch_s / 0.1 - np.round(rows.epoch_s / 0.1))
    assert (off_knots > 0.01).sum() > 18


def test_goals_lie_beyond_the_window_and_within_the_solution(walk):
    rows = segments_of(walk(4))
    ahead = rows.goal_time_s - rows.epoch_s
    assert (rows.goal_time_s <= 7.5).all()
    assert ((ahead >= 1.0) | np.isclose(rows.goal_time_s, 7.5)).all()
    assert (ahead <= 4.0).all()
    assert len(np.unique(rows.goal_time_s)) == len(rows.goal_time_s)


def test_one_stream_gives_one_set_of_segments(walk):
    first, again, other = (segments_of(walk(1), index=i) for i in (5, 5, 6))
    assert np.array_equal(first.x, again.x)
    assert not np.array_equal(first.epoch_s, other.epoch_s)


def test_a_solution_without_a_window_yields_no_rows(walk):
    example = walk(1)
    times = example.trajectory.contact_times.copy()
    times[0, 1:-1] = np.linspace(0.001, 0.012, 12)  # one foot does all its swings at once
    hasty = replace(example, trajectory=replace(example.trajectory, contact_times=times))
    rows = segments_of(hasty)
    assert rows.x.shape == (0, TASK_LAYOUT.size)
    assert rows.tau.shape == (0, SEGMENT_LAYOUT.size)


def test_goals_within_the_window_are_refused():
    with pytest.raises(ValidationError, match="goal_horizon must ascend"):
        SegmentationSettings(goal_horizon=(0.5, 2.0))
