"""Clearances and violations of hand-made motions, whose values are known."""

from collections.abc import Callable

import numpy as np
import pytest

from lmtr.robot.model import ANYMAL
from lmtr.rollout.metrics import forward_offset, forward_violation, obstacle_clearances
from lmtr.rollout.settings import Criteria
from lmtr.rollout.tally import Tally
from lmtr.trajectory.motion import Footholds, Motion, sampled

SQUARE = np.pi / 2.0
BASE_W = np.array([1.0, 2.0, ANYMAL.nominal_height])


def walked(x_by_foot, tracks=(0.2, -0.2, 0.2, -0.2)):
    """A motion whose feet stand at these x, one after the other, on straight tracks."""
    holds = [
        (foot, x, tracks[foot], k) for foot, xs in enumerate(x_by_foot) for k, x in enumerate(xs)
    ]
    foot, x, y, order = (np.array(column) for column in zip(*holds, strict=True))
    return still(Footholds(foot, np.stack([x, y], axis=-1), 1.0 * order, order + 0.5))


def still(footholds, samples=3, rpy=(0.0, 0.0, 0.0)):
    """A base at rest over feet in neutral stance."""
    return Motion(
        times=0.1 * np.arange(samples),
        base_position_W=np.tile(BASE_W, (samples, 1)),
        base_rpy=np.tile(rpy, (samples, 1)),
        base_velocity_W=np.zeros((samples, 3)),
        base_angular_velocity_W=np.zeros((samples, 3)),
        foot_position_W=np.tile(ANYMAL.nominal_feet_B + BASE_W, (samples, 1, 1)),
        foot_force_W=np.zeros((samples, 4, 3)),
        contact=np.ones((samples, 4), dtype=bool),
        footholds=footholds,
    )


EMPTY = Footholds(np.zeros(0, dtype=int), np.zeros((0, 2)), np.zeros(0), np.zeros(0))


def test_closest_foothold_of_each_foot_to_a_line_square_to_the_path():
    motion = walked([(0.0, 0.9, 1.2), (0.0, 1.04, 1.3), (0.2, 0.7, 1.5), (0.0, 0.5, 1.01)])
    line = np.array([[1.0, 0.0, SQUARE]])
    np.testing.assert_allclose(
        obstacle_clearances(motion, line), [[0.1, 0.04, 0.3, 0.01]], atol=1e-12
    )


def test_clearance_is_measured_square_to_a_turned_line():
    motion = walked([(0.0, 2.0)] * 4)
    line = np.array([[1.0, 0.0, np.pi / 4.0]])
    # Feet at (0, y) and (2, y) are |y − (x − 1)|/√2 away; the line has the same angle reversed.
    expected = [[0.8 / np.sqrt(2.0), 0.8 / np.sqrt(2.0)] * 2]
    np.testing.assert_allclose(obstacle_clearances(motion, line), expected, atol=1e-12)
    line[:, 2] -= np.pi
    np.testing.assert_allclose(obstacle_clearances(motion, line), expected, atol=1e-12)


def test_a_line_counts_only_once_all_feet_have_crossed_it():
    motion = walked([(0.0, 1.2), (0.0, 1.2), (0.0, 0.8), (0.0, 1.2)])
    lines = np.array([[0.5, 0.0, SQUARE], [1.0, 0.0, SQUARE], [9.0, 0.0, SQUARE]])
    clearances = obstacle_clearances(motion, lines)
    np.testing.assert_allclose(clearances, [[0.5, 0.5, 0.3, 0.5]], atol=1e-12)
    behind = np.array([[-1.0, 0.0, SQUARE]])
    assert obstacle_clearances(motion, behind).shape == (0, 4)
    assert obstacle_clearances(motion, np.zeros((0, 3))).shape == (0, 4)


def test_a_line_that_the_robot_stepped_back_over_is_not_crossed():
    motion = walked([(0.0, 1.2, 0.5), (0.0, 1.2), (0.0, 1.2), (0.0, 1.2)])
    assert obstacle_clearances(motion, np.array([[1.0, 0.0, SQUARE]])).shape == (0, 4)


def test_clearances_do_not_depend_on_where_the_world_has_its_origin():
    motion = walked([(0.0, 0.9, 1.2), (0.0, 1.04, 1.3), (0.2, 0.7, 1.5), (0.0, 0.5, 1.01)])
    moved = still(
        Footholds(
            motion.footholds.foot,
            motion.footholds.position_W @ np.array([[0.0, 1.0], [-1.0, 0.0]]) + [3.0, -2.0],
            motion.footholds.touchdown,
            motion.footholds.liftoff,
        )
    )
    line = np.array([[1.0, 0.0, SQUARE + 0.2]])
    turned = np.array([[3.0, -1.0, np.pi + 0.2]])
    np.testing.assert_allclose(
        obstacle_clearances(moved, turned), obstacle_clearances(motion, line), atol=1e-12
    )


def test_a_foot_known_to_leave_its_range_by_three_centimetres():
    motion = still(EMPTY)
    motion.foot_position_W[1, 2, 0] -= 0.23
    motion.foot_position_W[2, 1, 0] += 0.2
    violation = forward_violation(motion, ANYMAL)
    expected = np.zeros((3, 4))
    expected[1, 2] = 0.03
    np.testing.assert_allclose(violation, expected, atol=1e-12)
    np.testing.assert_allclose(forward_offset(motion, ANYMAL)[1, 2], -0.23, atol=1e-12)


def test_swinging_feet_are_not_judged():
    motion = still(EMPTY)
    motion.foot_position_W[0, 0, 0] += 1.0
    motion.contact[0, 0] = False
    violation = forward_violation(motion, ANYMAL)
    assert np.isnan(violation[0, 0])
    assert np.nansum(violation) == 0.0
    tally = Tally.of(motion, np.zeros((0, 3)), ANYMAL, Criteria())
    assert (tally.contacts, tally.violation) == (11, 0.0)


def test_forward_is_the_base_axis_by_its_full_rotation():
    pitch = 0.1  # nose down: the base looks at the ground, so low feet count as further ahead
    motion = still(EMPTY, rpy=(0.0, pitch, 0.0))
    x, z = ANYMAL.nominal_feet_B[:, 0], -ANYMAL.nominal_height
    expected = x * np.cos(pitch) - z * np.sin(pitch) - x
    np.testing.assert_allclose(forward_offset(motion, ANYMAL)[0], expected, atol=1e-12)
    turned = still(EMPTY, rpy=(0.0, 0.0, SQUARE))
    sideways = ANYMAL.nominal_feet_B[:, 1] - x
    np.testing.assert_allclose(forward_offset(turned, ANYMAL)[0], sideways, atol=1e-12)


def test_tally_counts_each_threshold():
    motion = walked([(0.0, 0.9, 1.2), (0.0, 1.04, 1.3), (0.2, 0.7, 1.5), (0.0, 0.5, 1.01)])
    motion.foot_position_W[1, 2, 0] -= 0.23
    motion.foot_position_W[1, 3, 0] += 0.27
    motion.base_position_W[-1, 0] = 1.2
    motion.foot_position_W[-1, :, 0] += 0.2
    tally = Tally.of(motion, np.array([[1.0, 0.0, SQUARE]]), ANYMAL, Criteria())
    assert (tally.crossed, tally.steps, tally.close_steps) == (1, 4, 2)
    assert (tally.contacts, tally.large_violations) == (12, 1)
    assert tally.violation == pytest.approx(0.1)
    assert tally.distance == pytest.approx(0.2)
    assert tally.duration == pytest.approx(0.2)


def test_an_expert_solution_is_judged_like_a_rollout(walk: Callable):
    made = walk(3)
    motion, lines = sampled(made.trajectory, 0.1), made.task.obstacles_W
    clearances = obstacle_clearances(motion, lines)
    assert clearances.shape == (len(lines), 4)
    holds = made.trajectory.footholds
    for line, row in zip(lines, clearances, strict=True):
        normal = np.array([-np.sin(line[2]), np.cos(line[2])])
        distance = np.abs((holds[..., :2] - line[:2]) @ normal).min(axis=1)
        np.testing.assert_allclose(row, distance, atol=1e-12)
