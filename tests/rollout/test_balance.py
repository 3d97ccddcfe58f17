"""Dynamics and friction of hand-made motions, whose residuals are known."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lmtr.quality.residual import angular_residual, linear_residual, rigid_motion
from lmtr.robot.model import ANYMAL, GRAVITY
from lmtr.rollout.balance import friction_excess, mean_residuals, pull
from lmtr.trajectory.motion import sampled
from lmtr.trajectory.sample import sample_feet

STEP = 0.1


def test_a_robot_that_stands_on_its_weight_is_in_balance(standing):
    linear, angular = mean_residuals(standing(), ANYMAL)
    np.testing.assert_allclose(linear, np.zeros(9), atol=1e-12)
    np.testing.assert_allclose(angular, np.zeros(9), atol=1e-12)


def test_missing_force_is_missing_acceleration(standing):
    linear, _ = mean_residuals(standing(force_share=0.6), ANYMAL)
    np.testing.assert_allclose(linear, np.full(9, 0.4 * GRAVITY), rtol=1e-12)


def test_free_fall_needs_no_force(standing):
    motion = standing(force_share=0.0)
    motion.base_velocity_W[:, 2] = -GRAVITY * motion.times
    linear, _ = mean_residuals(motion, ANYMAL)
    np.testing.assert_allclose(linear, np.zeros(9), atol=1e-12)


def test_a_jump_of_velocity_at_a_replanning_is_seen_from_both_sides(standing):
    motion = standing()
    motion.base_velocity_W[5:, 0] += 0.1
    linear, _ = mean_residuals(motion, ANYMAL)
    expected = np.zeros(9)
    expected[[3, 4]] = 0.1 / (2.0 * STEP)  # samples 4 and 5 have it between their neighbours
    np.testing.assert_allclose(linear, expected, atol=1e-12)


def test_forces_that_change_like_a_cubic_are_integrated_exactly(standing):
    motion, t = standing(), STEP * np.arange(11)
    motion.foot_force_W[..., 0] = (0.25 * ANYMAL.mass * (t**3 - t**2))[:, None]
    motion.base_velocity_W[:, 0] = t**4 / 4.0 - t**3 / 3.0
    linear, _ = mean_residuals(motion, ANYMAL)
    np.testing.assert_allclose(linear, np.zeros(9), atol=1e-12)


def test_a_known_moment_is_a_known_angular_acceleration(standing):
    """The left feet bear all: m·g times their lever arm, about x."""
    motion = standing()
    motion.foot_force_W[:, [0, 2], 2] *= 2.0
    motion.foot_force_W[:, [1, 3], 2] = 0.0
    _, angular = mean_residuals(motion, ANYMAL)
    moment = np.array([ANYMAL.weight * ANYMAL.nominal_lateral, 0.0, 0.0])
    expected = np.linalg.norm(np.linalg.solve(ANYMAL.inertia_B, moment))
    np.testing.assert_allclose(angular, np.full(9, expected), rtol=1e-9)


def test_turning_the_world_changes_no_residual(standing):
    motion = standing()
    rng = np.random.default_rng(0)
    motion.foot_force_W[:] += rng.normal(0.0, 30.0, motion.foot_force_W.shape)
    motion.base_angular_velocity_W[:] = rng.normal(0.0, 0.3, (11, 3))
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turned = replace(
        motion,
        base_rpy=motion.base_rpy + np.array([0.0, 0.0, np.pi / 2.0]),
        **{
            name: getattr(motion, name) @ turn.T
            for name in (
                "base_position_W",
                "base_velocity_W",
                "base_angular_velocity_W",
                "foot_position_W",
                "foot_force_W",
            )
        },
    )
    for one, other in zip(
        mean_residuals(motion, ANYMAL), mean_residuals(turned, ANYMAL), strict=True
    ):
        np.testing.assert_allclose(other, one, rtol=1e-9)


def test_it_agrees_with_the_pointwise_residual_of_a_solution(walk: Callable):
    """Means over 2 ms of a lively walk are the differential residual, which is coded apart."""
    trajectory, step = walk(2).trajectory, 1e-3
    motion = sampled(trajectory, step)
    linear, angular = mean_residuals(motion, ANYMAL)
    inner = motion.times[1 : len(linear) + 1]
    base, feet = rigid_motion(trajectory, inner), sample_feet(trajectory, inner)
    for found, pointwise in (
        (linear, linear_residual(base, feet, ANYMAL)),
        (angular, angular_residual(base, feet, ANYMAL)),
    ):
        size = np.linalg.norm(pointwise, axis=-1)
        # Accelerations jump at nodes, and a difference across one is their mean.
        assert np.median(np.abs(found - size)) < 1e-3 * np.median(size)


def test_a_last_sample_off_the_grid_is_left_out(standing):
    motion = standing()
    motion.times[-1] -= 0.04
    linear, _ = mean_residuals(motion, ANYMAL)
    assert len(linear) == 8
    assert len(mean_residuals(standing(samples=2), ANYMAL)[0]) == 0


def test_friction_is_a_pyramid_and_pulling_is_beyond_it(standing):
    motion, mu = standing(samples=6), ANYMAL.friction
    normal = 0.25  # weights, of each foot
    force = motion.foot_force_W / ANYMAL.weight
    force[0, 0, 0] = 0.99 * mu * normal
    force[1, 1, 1] = -1.1 * mu * normal
    force[2, 2] = [0.0, 0.0, -0.02]
    force[3, 3, :2] = 0.99 * mu * normal  # outside of the cone
    force[4, 0] = [0.05, 0.01, -0.02]  # slides further than it pulls
    motion.foot_force_W[:] = force * ANYMAL.weight
    expected = np.zeros((6, 4))
    expected[1, 1], expected[2, 2], expected[4, 0] = 0.1 * mu * normal, 0.02, 0.05
    np.testing.assert_allclose(friction_excess(motion, ANYMAL), expected, atol=1e-12)
    pulled = np.zeros((6, 4))
    pulled[2, 2] = pulled[4, 0] = 0.02
    np.testing.assert_allclose(pull(motion, ANYMAL), pulled, atol=1e-12)


def test_a_foot_in_the_air_is_not_judged_by_friction(standing):
    motion = standing(samples=3)
    motion.foot_force_W[:, 0] = [0.0, 0.0, -0.1 * ANYMAL.weight]
    motion.contact[1, 0] = False
    for judged in (friction_excess(motion, ANYMAL), pull(motion, ANYMAL)):
        assert np.argwhere(np.isnan(judged)).tolist() == [[1, 0]]
