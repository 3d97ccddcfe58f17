"""A trajectory moved to another frame and time is the same motion."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lmtr.errors import DataError
from lmtr.geometry.se2 import SE2
from lmtr.trajectory.sample import sample_base, sample_feet
from lmtr.trajectory.trajectory import Trajectory

seeds = st.integers(0, 2**32 - 1)
sizes = st.fixed_dictionaries(
    {"stances": st.integers(1, 4), "nodes": st.integers(2, 9), "batch": st.sampled_from([(), (3,)])}
)
delays = st.floats(-5.0, 5.0)


def frames(seed, batch):
    return SE2.of(np.random.default_rng(seed).uniform(-3.0, 3.0, (*batch, 3)))


def same(one, other):
    for field in fields(Trajectory):
        ours, theirs = getattr(one, field.name), getattr(other, field.name)
        np.testing.assert_allclose(ours, theirs, atol=1e-11, err_msg=field.name)


@given(seed=seeds, size=sizes, delay=delays)
def test_seen_from_where_it_was_moved_to_it_is_itself(scramble, seed, size, delay):
    trajectory, frame = scramble(seed, **size), frames(seed, size["batch"])
    same(trajectory.moved(frame, delay).seen_from(frame, delay), trajectory)
    same(trajectory.seen_from(frame, delay).moved(frame, delay), trajectory)


@given(seed=seeds, size=sizes, delay=delays)
def test_two_moves_are_one(scramble, seed, size, delay):
    trajectory = scramble(seed, **size)
    inner, outer = frames(seed, size["batch"]), frames(seed + 1, size["batch"])
    twice = trajectory.moved(inner, delay).moved(outer, 0.5)
    same(twice, trajectory.moved(outer @ inner, delay + 0.5))


@given(seed=seeds, size=sizes, delay=delays)
def test_samples_of_a_moved_trajectory_are_the_moved_samples(scramble, seed, size, delay):
    trajectory, frame = scramble(seed, **size), frames(seed, size["batch"])
    moved = trajectory.moved(frame, delay)
    share = np.random.default_rng(seed).uniform(-0.2, 1.2, (*size["batch"], 20))
    begin, end = trajectory.base_start[..., None], trajectory.base_end[..., None]
    times = begin + share * (end - begin)

    base, base_moved = sample_base(trajectory, times), sample_base(moved, times + delay)
    turn = frame.over(1)
    yaw = np.array([0.0, 0.0, 1.0]) * turn.yaw[..., None]
    for found, expected in (
        (base_moved.position, turn.apply(base.position)),
        (base_moved.rpy, base.rpy + yaw),
        (base_moved.velocity, turn.rotate(base.velocity)),
        (base_moved.acceleration, turn.rotate(base.acceleration)),
        (base_moved.angular_velocity, turn.rotate(base.angular_velocity)),
        (base_moved.rpy_acceleration, base.rpy_acceleration),
    ):
        np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-7)

    feet, feet_moved = sample_feet(trajectory, times), sample_feet(moved, times + delay)
    assert np.array_equal(feet_moved.contact, feet.contact)
    assert np.array_equal(feet_moved.stance, feet.stance)
    turn = frame.over(2)
    for found, expected in (
        (feet_moved.position, turn.apply(feet.position)),
        (feet_moved.velocity, turn.rotate(feet.velocity)),
        (feet_moved.force, turn.rotate(feet.force)),
        (feet_moved.time_since_liftoff, feet.time_since_liftoff),
    ):
        np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-7)


def test_moving_leaves_the_original_alone(scramble):
    trajectory, untouched = scramble(1), scramble(1)
    trajectory.moved(SE2.of([1.0, 2.0, 0.5]), 3.0)
    for field in fields(Trajectory):
        assert np.array_equal(getattr(trajectory, field.name), getattr(untouched, field.name))


@given(seed=seeds, size=sizes)
def test_a_stack_gives_back_its_parts(scramble, seed, size):
    parts = [scramble(seed + k, **size) for k in range(3)]
    batch = Trajectory.stack(parts)
    assert batch.batch_shape == (3, *size["batch"])
    for k, part in enumerate(parts):
        same(batch[k], part)


@pytest.mark.parametrize("field", [field.name for field in fields(Trajectory)])
def test_one_number_that_is_not_finite_is_noticed_in_its_element_alone(scramble, field):
    trajectory = scramble(2, batch=(3,))
    broken = np.array(getattr(trajectory, field))
    broken[1].reshape(-1)[-1:] = np.nan
    if broken.ndim == 1:
        broken[1] = np.nan
    found = replace(trajectory, **{field: broken}).is_finite()
    assert found.tolist() == [True, False, True]


@pytest.mark.parametrize("field", ["base_start", "contact_times", "swing_nodes", "force_nodes"])
def test_arrays_that_do_not_belong_together_are_refused(scramble, field):
    other = getattr(scramble(3, stances=2, batch=(2,)), field)
    with pytest.raises(DataError, match=f"{field} must have shape"):
        replace(scramble(3, stances=3), **{field: other})
