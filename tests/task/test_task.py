"""Tasks are refused with the field and the mend named; streams depend on their key alone."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from lmtr.errors import TaskError
from lmtr.robot.model import ANYMAL
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import TaskDistribution, gait_order, sample_noise, sample_task

TASK = sample_task(TaskDistribution(), ANYMAL, stream(0, Purpose.TASK, 0))
NOISE = sample_noise(TaskDistribution(), 6, stream(0, Purpose.TASK, 0))


@pytest.mark.parametrize("name", ["start_pose_W", "start_feet_W", "goal_pose_W", "obstacles_W"])
def test_a_number_that_is_not_finite_is_refused_by_its_field(name):
    spoilt = np.array(getattr(TASK, name))
    spoilt.flat[0] = np.nan
    with pytest.raises(TaskError, match=name):
        replace(TASK, **{name: spoilt})


@pytest.mark.parametrize("name", ["amplitudes", "timing"])
@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_noise_that_is_not_finite_is_refused_by_its_field(name, wrong):
    spoilt = np.array(getattr(NOISE, name))
    spoilt[-1, -1] = wrong
    with pytest.raises(TaskError, match=f"noise: {name} must be finite"):
        replace(NOISE, **{name: spoilt})


@pytest.mark.parametrize(
    ("name", "shape"), [("amplitudes", (3, 2)), ("timing", (3, 12)), ("timing", (12,))]
)
def test_noise_of_another_shape_is_refused_by_its_field(name, shape):
    with pytest.raises(TaskError, match=f"noise: {name} must have shape"):
        replace(NOISE, **{name: np.zeros(shape)})


@pytest.mark.parametrize("first", [-1, 4])
def test_noise_names_one_of_four_places_of_the_walk(first):
    with pytest.raises(TaskError, match=f"noise: first must be a place from 0 to 3.*got {first}"):
        replace(NOISE, first=first)


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("noise_timing", -0.01),
        ("noise_pace", np.nan),
        ("noise_pairing", -1.0),
        ("noise_first_foot", 1.1),
    ],
)
def test_settings_of_noise_are_checked(name, wrong):
    with pytest.raises(ValidationError, match=name):
        TaskDistribution(**{name: wrong})


def test_noise_serves_the_number_of_swings_that_it_was_drawn_for():
    NOISE.require_scope(6)
    with pytest.raises(TaskError, match=r"timing must have shape \(4, 10\), got \(4, 12\)"):
        NOISE.require_scope(5)


def test_a_goal_out_of_reach_is_refused():
    far = replace(TASK, goal_pose_W=np.array([9.0, 0.0, 0.0]))
    with pytest.raises(TaskError, match=r"9\.00 m away.*bring the goal closer"):
        far.require_possible(ANYMAL, 7.5, 6, 0.008)


def test_a_start_foot_outside_its_range_of_motion_is_refused_by_its_name():
    feet = TASK.start_feet_W.copy()
    feet[2, 0] -= 0.5
    with pytest.raises(TaskError, match="LH"):
        replace(TASK, start_feet_W=feet).require_possible(ANYMAL, 7.5, 6, 0.008)


def test_a_start_foot_may_use_all_of_its_room_but_not_the_margin():
    def forward(offset):
        feet = ANYMAL.nominal_feet_B[:, :2].copy()
        feet[1, 0] += offset
        return replace(TASK, start_feet_W=feet)

    limit = ANYMAL.range_of_motion[0] - 0.01
    forward(limit).require_possible(ANYMAL, 7.5, 6, 0.01)
    beyond = forward(limit + 0.002)
    beyond.require_possible(ANYMAL, 7.5, 6, 0.0)
    with pytest.raises(TaskError, match=r"RF .* margin of 0\.01 m, got 0\.002 m beyond"):
        beyond.require_possible(ANYMAL, 7.5, 6, 0.01)


@given(st.integers(0, 2**63), st.integers(0, 10**9))
def test_every_drawn_task_is_possible_and_lies_in_its_ranges(seed, index):
    distribution = TaskDistribution()
    task = sample_task(distribution, ANYMAL, stream(seed, Purpose.TASK, index))
    task.require_possible(ANYMAL, 7.5, 6, 0.008)
    low, high = distribution.goal_distance
    assert low <= task.goal_pose_W[0] <= high
    assert len(task.obstacles_W) == 2


def test_the_same_key_draws_the_same_and_another_one_does_not():
    def draw(seed, index):
        rng = stream(seed, Purpose.TASK, index)
        task = sample_task(TaskDistribution(), ANYMAL, rng)
        return np.concatenate(
            [task.goal_pose_W, sample_noise(TaskDistribution(), 6, rng).timing[0]]
        )

    np.testing.assert_array_equal(draw(3, 7), draw(3, 7))
    assert not np.allclose(draw(3, 7), draw(3, 8))
    assert not np.allclose(draw(3, 7), draw(4, 7))


def test_smooth_noise_vanishes_at_both_ends():
    noise = sample_noise(TaskDistribution(), 6, stream(0, Purpose.TASK, 0))
    np.testing.assert_allclose(noise.on_base(np.array([0.0, 1.0])), 0.0, atol=1e-12)


@pytest.mark.parametrize("foot", range(4))
def test_the_gait_begins_with_the_foot_furthest_back(foot):
    feet = ANYMAL.nominal_feet_B[:, :2].copy()
    feet[foot, 0] -= 0.05
    order = gait_order(replace(TASK, start_feet_W=feet), ANYMAL)
    assert order[0] == foot
    assert sorted(order) == [0, 1, 2, 3]
