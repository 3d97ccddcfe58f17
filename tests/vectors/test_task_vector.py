"""The task vector: state, goal and obstacle lines as the robot sees them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lmtr.geometry.se2 import SE2
from lmtr.robot.model import FEET
from lmtr.trajectory.trajectory import Trajectory
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT
from lmtr.vectors.state import state_at
from lmtr.vectors.task_vector import DUMMY_AHEAD, encode_task, next_lines

ORIGIN = SE2.of([0.0, 0.0, 0.0])
METRES = st.floats(-5.0, 5.0)
TURN = st.floats(-3.0, 3.0)


def square(distance, *others):
    """Lines square to the x axis at the given distances ahead."""
    return np.array([[d, 0.0, np.pi / 2.0] for d in (distance, *others)])


def test_state_is_that_of_a_finite_difference_in_the_segment_frame(walk):
    trajectory = walk(1).trajectory
    epoch, step = 3.37, 1e-5
    state = state_at(trajectory, epoch)
    before, after = state_at(trajectory, epoch - step), state_at(trajectory, epoch + step)
    moved = state.frame_W.invert() @ after.frame_W
    back = state.frame_W.invert() @ before.frame_W
    velocity = (moved.array() - back.array()) / (2.0 * step)
    assert state.linear_velocity_S[:2] == pytest.approx(velocity[:2], abs=1e-6)
    climb = (after.height - before.height) / (2.0 * step)
    assert state.linear_velocity_S[2] == pytest.approx(climb, abs=1e-6)
    # With x along the base's yaw, the yaw rate is ω_z less what roll rate and pitch feed into it.
    pitch = state.roll_pitch[1]
    roll_rate = (after.roll_pitch[0] - before.roll_pitch[0]) / (2.0 * step)
    yaw_rate = state.angular_velocity_S[2] + np.sin(pitch) * roll_rate
    assert yaw_rate == pytest.approx(velocity[2], abs=1e-6)


def test_time_since_liftoff_counts_in_swing_only(walk):
    trajectory = walk(2).trajectory
    liftoff, touchdown = trajectory.liftoff_times[1, 2], trajectory.touchdown_times[1, 2]
    epochs = np.array([liftoff - 0.01, liftoff + 0.07, touchdown + 0.01])
    assert state_at(trajectory, epochs).time_since_liftoff[:, 1] == pytest.approx([0.0, 0.07, 0.0])


def test_batched_epochs_equal_single_ones(walk):
    batch = Trajectory.stack([walk(seed).trajectory for seed in (1, 2, 3)])
    epochs = np.array([[1.0, 2.2], [3.13, 4.0], [5.0, 6.1]])
    lines, goal = square(0.7, 1.9), np.array([2.0, 0.3, 0.2])
    together = encode_task(state_at(batch, epochs), lines, goal)
    for i in range(3):
        one = state_at(batch[i], float(epochs[i, 1]))
        assert encode_task(one, lines, goal) == pytest.approx(together[i, 1], abs=1e-12)
    same = encode_task(state_at(batch, 2.0), lines, goal)
    assert same[1] == pytest.approx(encode_task(state_at(batch[1], 2.0), lines, goal), abs=1e-12)


@given(x=METRES, y=METRES, yaw=TURN, epoch=st.floats(0.0, 7.5))
def test_the_task_does_not_change_when_the_world_is_moved(walk, x, y, yaw, epoch):
    example, move = walk(3), SE2.of([x, y, yaw])
    lines, goal = example.task.obstacles_W, SE2.of(example.task.goal_pose_W)
    moved_lines = np.concatenate([move.apply(lines[:, :2]), lines[:, 2:] + yaw], axis=-1)
    here = encode_task(state_at(example.trajectory, epoch), lines, goal.array())
    there = encode_task(
        state_at(example.trajectory.moved(move), epoch), moved_lines, (move @ goal).array()
    )
    assert there == pytest.approx(here, abs=1e-9)


def test_a_standing_robot_is_encoded_as_it_stands(walk):
    example = walk(4)
    x = TASK_LAYOUT.unpack(
        encode_task(
            state_at(example.trajectory, 0.0), square(0.8, 1.5), np.array([2.0, -0.5, np.pi / 2])
        )
    )
    assert x["height"] == pytest.approx(0.42)
    for name in ("roll_pitch", "linear_velocity", "angular_velocity"):
        assert x[name] == pytest.approx(0.0, abs=1e-12)
    assert x["RH_position"] == pytest.approx([*example.task.start_feet_W[3], 0.0])
    assert x["next_lines"] == pytest.approx(square(0.8, 1.5))
    assert x["goal_position"] == pytest.approx([2.0, -0.5])
    assert x["goal_heading"] == pytest.approx([0.0, 1.0], abs=1e-12)


def test_lines_come_nearest_first_and_leave_half_a_metre_behind():
    assert next_lines(square(1.4, -0.49, 0.6), ORIGIN) == pytest.approx(square(-0.49, 0.6))
    assert next_lines(square(1.4, -0.51, 0.6), ORIGIN) == pytest.approx(square(0.6, 1.4))


@given(along=METRES, turn=st.sampled_from([-np.pi, 0.0, np.pi]), alpha=st.floats(0.3, 2.8))
def test_any_description_of_a_line_gives_the_same_numbers(along, turn, alpha):
    point = np.array([0.9, 0.2]) + along * np.array([np.cos(alpha), np.sin(alpha)])
    line = next_lines(np.array([[0.9, 0.2, alpha]]), ORIGIN)
    again = next_lines(np.array([[*point, alpha + turn]]), ORIGIN)
    assert again == pytest.approx(line, abs=1e-9)


def test_distance_of_a_turned_line_is_measured_square_to_it():
    # A line turned by 60 degrees that crosses the x axis at 1.5 m is nearer than 1.4 m.
    oblique = np.array([[1.5, 0.0, np.pi / 2.0 - np.pi / 3.0]])
    first = next_lines(np.concatenate([square(1.4), oblique]), ORIGIN)[0]
    assert np.hypot(*first[:2]) == pytest.approx(1.5 * np.cos(np.pi / 3.0))


def test_missing_lines_become_the_same_dummies_everywhere():
    nothing = next_lines(np.zeros((0, 3)), ORIGIN)
    assert nothing[0] == pytest.approx(square(DUMMY_AHEAD)[0])
    assert nothing[1, 0] > nothing[0, 0]
    elsewhere = next_lines(np.full((4, 3), np.nan), SE2.of([3.0, -1.0, 2.0]))
    assert elsewhere == pytest.approx(nothing)
    assert next_lines(square(0.5), ORIGIN) == pytest.approx(square(0.5, DUMMY_AHEAD))
    assert np.diff(next_lines(square(3.0), ORIGIN)[:, 0]) > 0.0


def test_no_foothold_of_a_segment_lies_as_far_ahead_as_a_dummy(walk_segments):
    dummy = next_lines(np.zeros((0, 3)), ORIGIN)[0, 0]
    parts = SEGMENT_LAYOUT.unpack(walk_segments.tau)
    ahead = [
        parts[f"{foot}_{which}_foothold"][:, 0] for foot in FEET for which in ("first", "second")
    ]
    assert 0.5 < np.max(ahead) < dummy - 0.5


def test_padding_lines_with_nan_changes_nothing():
    frames = SE2.of([[0.0, 0.0, 0.1], [0.4, 0.1, -0.2]])
    lines = square(0.7, 1.5, 2.2)
    padded = np.concatenate([np.full((1, 3), np.nan), lines, np.full((2, 3), np.nan)])
    assert next_lines(padded, frames) == pytest.approx(next_lines(lines, frames), abs=0.0)
