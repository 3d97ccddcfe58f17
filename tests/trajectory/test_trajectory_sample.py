"""Samples are the splines that the nodes define, and contacts change when they are said to."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline

from lmtr.robot.model import N_FEET
from lmtr.trajectory.motion import sampled
from lmtr.trajectory.nodes import POSITION, RATE, RPY, SWING_POSITION, SWING_VELOCITY, VALUE
from lmtr.trajectory.sample import sample_base, sample_each_foot, sample_feet
from lmtr.trajectory.trajectory import BASE_STEP, FORCE_PIECES

seeds = st.integers(0, 2**32 - 1)


@given(seed=seeds, nodes=st.integers(2, 9))
def test_the_base_is_the_hermite_spline_of_its_nodes(scramble, seed, nodes):
    trajectory = scramble(seed, nodes=nodes)
    knots = trajectory.base_start + BASE_STEP * np.arange(nodes)
    times = np.random.default_rng(seed).uniform(knots[0], knots[-1], 30)
    base = sample_base(trajectory, times)
    spline = CubicHermiteSpline(
        knots, trajectory.base_nodes[:, VALUE], trajectory.base_nodes[:, RATE]
    )
    found = ((base.position, base.rpy), (base.velocity, base.rpy_rate))
    found += ((base.acceleration, base.rpy_acceleration),)
    for order, (linear, angular) in enumerate(found):
        expected, scale = spline(times, order), BASE_STEP**-order
        np.testing.assert_allclose(linear, expected[:, POSITION], rtol=1e-7, atol=1e-9 * scale)
        np.testing.assert_allclose(angular, expected[:, RPY], rtol=1e-7, atol=1e-9 * scale)


def changes(trajectory, foot):
    """Lift-offs and touch-downs of a foot, in s."""
    return trajectory.liftoff_times[foot], trajectory.touchdown_times[foot]


@given(seed=seeds, stances=st.integers(2, 4))
def test_a_contact_change_belongs_to_the_later_phase(scramble, seed, stances):
    trajectory = scramble(seed, stances=stances)
    for foot in range(N_FEET):
        liftoffs, touchdowns = changes(trajectory, foot)
        for times, stands in ((liftoffs, False), (touchdowns, True)):
            at, before = (sample_feet(trajectory, t) for t in (times, np.nextafter(times, -99.0)))
            assert (at.contact[:, foot] == stands).all()
            assert (before.contact[:, foot] != stands).all()
            np.testing.assert_allclose(at.time_since_liftoff[:, foot], 0.0)
        lifted = sample_feet(trajectory, liftoffs)
        assert lifted.stance[:, foot].tolist() == list(range(stances - 1))
        np.testing.assert_allclose(
            lifted.position[:, foot], trajectory.footholds[foot, :-1], atol=1e-12
        )
        landed = sample_feet(trajectory, touchdowns)
        assert landed.stance[:, foot].tolist() == list(range(1, stances))
        assert np.array_equal(landed.position[:, foot], trajectory.footholds[foot, 1:])


@given(seed=seeds)
def test_a_swing_leaves_rest_passes_its_node_and_comes_to_rest(scramble, seed):
    trajectory = scramble(seed)
    for foot in range(N_FEET):
        liftoffs, touchdowns = changes(trajectory, foot)
        middle = sample_feet(trajectory, 0.5 * (liftoffs + touchdowns))
        node = trajectory.swing_nodes[foot]
        np.testing.assert_allclose(middle.position[:, foot], node[:, SWING_POSITION], atol=1e-9)
        velocity = middle.velocity[:, foot]
        np.testing.assert_allclose(velocity[:, :2], node[:, SWING_VELOCITY], atol=1e-9)
        np.testing.assert_allclose(velocity[:, 2], 0.0, atol=1e-9)
        since = middle.time_since_liftoff[:, foot]
        np.testing.assert_allclose(since, 0.5 * (touchdowns - liftoffs), atol=1e-12)
        for edge in (liftoffs, touchdowns - 1e-9):
            np.testing.assert_allclose(
                sample_feet(trajectory, edge).velocity[:, foot], 0.0, atol=1e-4
            )


@given(seed=seeds, at=st.floats(0.1, 0.9))
def test_foot_velocity_is_the_rate_of_its_position(scramble, seed, at):
    trajectory, step = scramble(seed), 1e-6
    for foot in range(N_FEET):
        liftoffs, touchdowns = changes(trajectory, foot)
        times = liftoffs + (at if at < 0.45 else at + 0.05) * (touchdowns - liftoffs)
        ahead, behind = (sample_feet(trajectory, times + s * step).position for s in (1, -1))
        rate = (ahead - behind)[:, foot] / (2.0 * step)
        velocity = sample_feet(trajectory, times).velocity[:, foot]
        np.testing.assert_allclose(velocity, rate, rtol=1e-5, atol=1e-5)


@given(seed=seeds, stances=st.integers(1, 4))
def test_forces_pass_their_nodes_and_vanish_in_swing(scramble, seed, stances):
    trajectory = scramble(seed, stances=stances)
    for foot in range(N_FEET):
        times = trajectory.contact_times[foot].reshape(stances, 2)
        for k in range(FORCE_PIECES):  # the end of a stance belongs to its swing
            at = times[:, 0] + k / FORCE_PIECES * (times[:, 1] - times[:, 0])
            force = sample_feet(trajectory, at).force[:, foot]
            np.testing.assert_allclose(force, trajectory.force_nodes[foot, :, k, VALUE], atol=1e-9)
        liftoffs, touchdowns = changes(trajectory, foot)
        swinging = sample_feet(trajectory, 0.3 * liftoffs + 0.7 * touchdowns)
        assert (swinging.force[:, foot] == 0.0).all()
        assert not swinging.contact[:, foot].any()


@given(seed=seeds, stances=st.integers(1, 4))
def test_feet_stand_before_their_first_stance_and_after_their_last(scramble, seed, stances):
    trajectory = scramble(seed, stances=stances)
    times = np.array([trajectory.contact_times.min() - 1.0, trajectory.contact_times.max() + 1.0])
    feet = sample_feet(trajectory, times)
    assert feet.contact.all()
    for k, stance in enumerate((0, -1)):
        assert np.array_equal(feet.position[k], trajectory.footholds[:, stance])
    assert (feet.velocity == 0.0).all()


@given(seed=seeds, stances=st.integers(1, 4))
def test_feet_sampled_at_times_of_their_own_are_those_sampled_together(scramble, seed, stances):
    trajectory = scramble(seed, stances=stances)
    times = np.random.default_rng(seed).uniform(-1.0, 3.0, (N_FEET, 20))
    apart = vars(sample_each_foot(trajectory, times))
    for foot in range(N_FEET):
        for name, expected in vars(sample_feet(trajectory, times[foot])).items():
            assert np.array_equal(apart[name][:, foot], expected[:, foot]), name


@given(seed=seeds, stances=st.integers(1, 4))
def test_a_batch_is_sampled_as_its_members_are(scramble, seed, stances):
    batch = scramble(seed, stances=stances, batch=(2, 3))
    times = np.random.default_rng(seed).uniform(-1.0, 3.0, (2, 3, 20))
    base, feet = sample_base(batch, times), vars(sample_feet(batch, times))
    for member in np.ndindex(2, 3):
        alone = sample_base(batch[member], times[member])
        for name in ("position", "rpy_rate", "acceleration"):
            assert np.array_equal(getattr(base, name)[member], getattr(alone, name)), name
        for name, expected in vars(sample_feet(batch[member], times[member])).items():
            assert np.array_equal(feet[name][member], expected), name


@given(seed=seeds, nodes=st.integers(2, 9), dt=st.floats(0.003, 0.2))
def test_a_sampled_motion_reaches_from_the_first_node_to_the_last(scramble, seed, nodes, dt):
    trajectory = scramble(seed, nodes=nodes)
    motion = sampled(trajectory, dt)
    gaps = np.diff(motion.times)
    assert motion.times[0] == trajectory.base_start
    np.testing.assert_allclose(motion.times[-1], trajectory.base_end, atol=2e-9)
    assert (gaps > 0.0).all()
    np.testing.assert_allclose(gaps[:-1], dt, rtol=1e-9)
    for row, foot in enumerate(motion.footholds.foot):
        stance = row % trajectory.n_stances
        times = trajectory.contact_times[foot, 2 * stance : 2 * stance + 2]
        assert (motion.footholds.touchdown[row], motion.footholds.liftoff[row]) == tuple(times)
        place = trajectory.footholds[foot, stance, :2]
        assert np.array_equal(motion.footholds.position_W[row], place)
