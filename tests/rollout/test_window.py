"""Feet in one replanning window: anchored in stance, never jumping in swing."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lmtr.geometry.se2 import SE2
from lmtr.robot.model import ANYMAL
from lmtr.rollout.contacts import Feet
from lmtr.rollout.settings import RolloutSettings
from lmtr.rollout.window import Instant, carry_out
from lmtr.trajectory.sample import sample_feet
from lmtr.trajectory.trajectory import Trajectory
from lmtr.vectors.segment_vector import ordered_times
from lmtr.vectors.state import RobotState

FEET_S = ANYMAL.nominal_feet_B * [1.0, 1.0, 0.0]


def plan_with(times, step=0.2, stray=0.0, height=0.004):
    """A standing base whose feet step forward at these times (4,), first footholds astray."""
    nodes = np.zeros((1, 9, 2, 6))
    nodes[:, :, 0, 2] = ANYMAL.nominal_height
    first = FEET_S + np.array([stray, -stray, height])  # regressors miss the ground by millimetres
    holds = np.stack([first, first + np.array([step, 0.0, 0.0])], axis=-2)[None]
    middle = first + np.array([step / 2.0, 0.0, 0.08])
    speed = np.broadcast_to([1.0, 0.0], (4, 2))
    return Trajectory(
        base_start=np.zeros(1),
        base_nodes=nodes,
        contact_times=np.broadcast_to(ordered_times(np.array(times)), (1, 4, 4)),
        footholds=holds,
        swing_nodes=np.concatenate([middle, speed], axis=-1)[None, :, None],
        force_nodes=np.ones((1, 4, 2, 3, 2, 3)),
    )


def instant(stands, feet_W, since):
    shape = (1, 4)
    state = RobotState(
        frame_W=SE2(np.zeros(1), np.zeros(1), np.zeros(1)),
        height=np.full(1, ANYMAL.nominal_height),
        roll_pitch=np.zeros((1, 2)),
        linear_velocity_S=np.zeros((1, 3)),
        angular_velocity_S=np.zeros((1, 3)),
        feet_S=feet_W,
        time_since_liftoff=np.full(shape, since),
    )
    feet = Feet(np.full(shape, stands), feet_W, np.full(shape, since))
    return Instant(state, np.zeros((1, 3)), feet)


def test_a_standing_foot_keeps_its_place_until_liftoff_and_lands_on_the_planned_one():
    before = instant(stands=True, feet_W=FEET_S[None] + [0.03, 0.01, 0.0], since=0.0)
    plan = plan_with((-0.5, 0.05, 0.25, 0.9))
    samples = carry_out(plan, before, RolloutSettings()).samples
    feet = samples.foot_position_W[0]
    np.testing.assert_array_equal(samples.contact[0, :, 0], [True, False, False, True])
    np.testing.assert_array_equal(feet[0], before.feet.position_W[0])
    np.testing.assert_array_equal(feet[3], FEET_S + np.array([0.2, 0.0, 0.0]))
    assert (feet[1:3, :, 2] > 0.0).all()
    assert not samples.foot_force_W[0, 1:3].any()


def test_a_foot_in_the_air_keeps_the_time_since_its_real_liftoff():
    before = instant(stands=False, feet_W=FEET_S[None] + [0.05, 0.0, 0.06], since=0.12)
    window = carry_out(plan_with((-0.9, -0.2, 0.5, 1.2)), before, RolloutSettings())
    np.testing.assert_allclose(window.end.feet.time_since_liftoff, 0.42, atol=1e-15)
    np.testing.assert_array_equal(
        window.end.state.time_since_liftoff, window.end.feet.time_since_liftoff
    )
    lifting = carry_out(
        plan_with((-0.5, 0.1, 0.5, 0.9)), instant(True, FEET_S[None], 0.0), RolloutSettings()
    )
    np.testing.assert_allclose(lifting.end.feet.time_since_liftoff, 0.2, atol=1e-15)


def test_the_distance_from_the_planned_swing_is_halved_half_way_to_touchdown():
    offset = np.array([0.04, -0.02, 0.0])
    plan = plan_with((-0.9, -0.1, 0.2, 1.2), height=0.0)
    agreeing = instant(False, planned_at_epoch(plan), 0.1)
    exact = carry_out(plan, agreeing, RolloutSettings())
    np.testing.assert_allclose(exact.foot_jump, 0.0, atol=1e-15)
    away = instant(False, planned_at_epoch(plan) + offset, 0.1)
    window = carry_out(plan, away, RolloutSettings())
    np.testing.assert_allclose(window.foot_jump, np.linalg.norm(offset), atol=1e-15)
    distance = window.samples.foot_position_W - exact.samples.foot_position_W
    np.testing.assert_allclose(distance[0, 1], np.broadcast_to(offset / 2.0, (4, 3)), atol=1e-15)
    np.testing.assert_allclose(distance[0, 2:], 0.0, atol=1e-15)


def test_a_low_foot_under_a_high_descending_swing_does_not_dig_into_the_ground():
    before = instant(False, FEET_S[None] + np.array([0.1, 0.0, 0.002]), since=0.3)
    window = carry_out(plan_with((-0.9, -0.35, 0.2, 1.2), height=0.0), before, RolloutSettings())
    assert not window.samples.contact[0, 1].any()
    assert (window.samples.foot_position_W[0, 1, :, 2] == 0.0).all()


def planned_at_epoch(plan):
    return sample_feet(plan, np.zeros((1, 1))).position[:, 0]


times = st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).map(sorted)


@settings(deadline=None, max_examples=300)
@given(
    times=times,
    stands=st.booleans(),
    stray=st.floats(-0.1, 0.1),
    height=st.floats(0.0, 0.08),
    since=st.floats(0.01, 0.4),
)
def test_whatever_the_plan_says_feet_are_continuous_and_stand_on_the_ground(
    times, stands, stray, height, since
):
    feet_W = FEET_S[None] + [0.02, 0.0, 0.0 if stands else height]
    before = instant(stands, feet_W, 0.0 if stands else since)
    rules = RolloutSettings()
    window = carry_out(plan_with(times, stray=stray), before, rules)
    samples, changes = window.samples, window.changes
    np.testing.assert_allclose(samples.foot_position_W[:, 0], feet_W, atol=1e-15)
    assert (samples.foot_position_W[..., 2] >= 0.0).all()
    assert (samples.foot_position_W[..., 2][samples.contact] == 0.0).all()
    # Changes alternate: landing, lift-off, touch-down; and lead from this state to the next one.
    assert not (changes.liftoff < np.where(np.isinf(changes.landing), 0.0, changes.landing)).any()
    touched = changes.touchdown <= rules.period
    assert (changes.touchdown > np.where(np.isinf(changes.liftoff), -1.0, changes.liftoff)).all()
    number = (
        (changes.landing <= rules.period).astype(int) + (changes.liftoff <= rules.period) + touched
    )
    np.testing.assert_array_equal(window.end.feet.stands, (number % 2 == 1) ^ stands)
    since_end = window.end.feet.time_since_liftoff
    assert ((since_end == 0.0) | ~window.end.feet.stands).all()
    assert (since_end >= 0.0).all()
