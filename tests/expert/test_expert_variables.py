"""Packing: blocks have names, and a trajectory survives the way through the variables."""

from dataclasses import fields

import numpy as np
import pytest

from lmtr.errors import DataError
from lmtr.expert.blocks import Blocks
from lmtr.expert.constraints.dynamics import LEVER_ARM
from lmtr.expert.quantities import linear_map, quantity_blocks
from lmtr.expert.stances import n_force_points, stance_points
from lmtr.expert.variables import pack, unpack
from lmtr.geometry.rotation import rotation_matrix
from lmtr.robot.model import ANYMAL, GRAVITY
from lmtr.trajectory.sample import sample_base, sample_feet
from lmtr.trajectory.trajectory import BASE_STEP


def test_blocks_pack_what_they_unpack():
    blocks = Blocks({"a": (2, 3), "b": (), "c": (4,)})
    vector = np.arange(blocks.size, dtype=float)
    np.testing.assert_array_equal(blocks.pack(blocks.unpack(vector)), vector)


def test_blocks_refuse_missing_blocks():
    with pytest.raises(DataError, match="name them all"):
        Blocks({"a": (2,), "b": (1,)}).pack({"a": 1.0})


@pytest.mark.parametrize("n_stances", [2, 3, 7])
def test_stances_share_out_all_force_points(n_stances):
    index = np.arange(n_force_points(n_stances))
    shared = [index[stance_points(stance, n_stances)] for stance in range(n_stances)]
    np.testing.assert_array_equal(np.concatenate(shared), index)


def test_guess_comes_back_from_its_variables(drawn):
    again = unpack(drawn.start, drawn.guess, ANYMAL, drawn.settings.scope)
    for field in fields(again):
        np.testing.assert_allclose(
            getattr(again, field.name), getattr(drawn.guess.trajectory, field.name), atol=1e-12
        )


def test_any_variables_come_back_from_their_trajectory(drawn):
    scope, x = drawn.settings.scope, drawn.near_start(0)
    trajectory = unpack(x, drawn.guess, ANYMAL, scope)
    control = drawn.guess.control_points.copy()
    inner = drawn.problem.variables.unpack(x)["control"]
    control[3:-3] = inner
    guess = type(drawn.guess)(control, trajectory, drawn.guess.order)
    np.testing.assert_allclose(pack(guess, ANYMAL, scope), x, atol=1e-12)


def test_quantities_are_those_of_the_sampled_trajectory(drawn):
    settings, x = drawn.settings, drawn.near_start(7)
    linear = linear_map(settings)
    q = quantity_blocks(settings).unpack(
        linear.of_variables @ x + linear.of_parameters @ drawn.parameters + linear.constant
    )
    trajectory = unpack(x, drawn.guess, ANYMAL, settings.scope)
    times = BASE_STEP / settings.base_samples_per_knot * np.arange(len(q["position"]))
    assert times[-1] == pytest.approx(settings.scope.duration)
    base = sample_base(trajectory, times)
    np.testing.assert_allclose(q["position"], base.position, atol=1e-12)
    np.testing.assert_allclose(q["rpy"], base.rpy, atol=1e-12)
    np.testing.assert_allclose(q["rpy_rate"], base.rpy_rate, atol=1e-10)
    np.testing.assert_allclose(q["acceleration"], base.acceleration, atol=1e-8)
    np.testing.assert_allclose(q["rpy_acceleration"], base.rpy_acceleration, atol=1e-8)
    order = list(drawn.guess.order)
    np.testing.assert_allclose(q["footholds"], trajectory.footholds[order, :, :2], atol=1e-12)
    np.testing.assert_allclose(q["middle"], trajectory.swing_nodes[order, :, :3], atol=1e-12)
    half = (trajectory.touchdown_times - trajectory.liftoff_times)[order, :, None] / 2.0
    velocity = trajectory.swing_nodes[order, :, 3:]
    np.testing.assert_allclose(q["middle_slope"], velocity * half, atol=1e-12)


def test_range_of_motion_rows_are_offsets_of_the_sampled_feet(drawn):
    """Gating without branches and look-ups by phase describe the same feet."""
    x, settings = drawn.near_start(8), drawn.settings
    rows = np.array(drawn.problem.functions.constraints(x, drawn.parameters)).reshape(-1)
    rows = rows[drawn.problem.rows["range_of_motion"]].reshape(-1, 4, 3)
    trajectory = unpack(x, drawn.guess, ANYMAL, settings.scope)
    times = settings.range_of_motion_step * np.arange(1, len(rows) + 1)
    base, feet = sample_base(trajectory, times), sample_feet(trajectory, times)
    order = list(drawn.guess.order)
    arm_W = feet.position[:, order] - base.position[:, None]
    arm_B = np.einsum("tji,tfj->tfi", rotation_matrix(base.rpy), arm_W)
    offset = (arm_B - ANYMAL.nominal_feet_B[order]) / np.array(ANYMAL.range_of_motion)
    np.testing.assert_allclose(rows, offset, atol=1e-9)


def test_dynamics_rows_are_mean_balances_of_forces_and_moments(drawn):
    """By Simpson's rule with the hat function of each inner node; at the ends, the balance."""
    x = drawn.near_start(9)
    rows = np.array(drawn.problem.functions.constraints(x, drawn.parameters)).reshape(-1)
    rows = rows[drawn.problem.rows["dynamics"]].reshape(-1, 6)
    trajectory = unpack(x, drawn.guess, ANYMAL, drawn.settings.scope)
    balance = _balance(trajectory, drawn.guess.trajectory)
    np.testing.assert_allclose(rows[[0, -1]], balance[[0, -1]], atol=5e-5)
    means = (balance[1:-2:2] + balance[2:-1:2] + balance[3::2]) / 3.0
    np.testing.assert_allclose(rows[1:-1], means, atol=1e-5)
    assert np.abs(means).max() > 0.01


def _balance(trajectory, guess):
    """Forces less the change of momentum every half knot, (M, 6) in weights and lever arms.

    Moments are taken about the base of the guess.
    """
    times = 0.5 * BASE_STEP * np.arange(2 * len(trajectory.base_nodes) - 1)
    # Differences need room on both sides; nothing moves at the ends.
    inside = np.clip(times, 2e-5, times[-1] - 2e-5)
    base, feet = sample_base(trajectory, times), sample_feet(trajectory, times)
    force = feet.force.sum(axis=1) / ANYMAL.weight
    linear = force - base.acceleration / GRAVITY - np.array([0.0, 0.0, 1.0])
    moment = np.cross(feet.position - base.position[:, None], feet.force).sum(axis=1)
    step = 1e-5
    change = (_spin(trajectory, inside + step) - _spin(trajectory, inside - step)) / (2.0 * step)
    arm = base.position - sample_base(guess, times).position
    angular = (moment - change) / ANYMAL.weight + np.cross(arm, linear)
    return np.concatenate([linear, angular / LEVER_ARM], axis=1)


def _spin(trajectory, times):
    """Angular momentum about the centre of mass, world axes, (M, 3) in N·m·s."""
    base = sample_base(trajectory, times)
    rotation = rotation_matrix(base.rpy)
    omega_B = np.einsum("tji,tj->ti", rotation, base.angular_velocity)
    return np.einsum("tij,jk,tk->ti", rotation, ANYMAL.inertia_B, omega_B)
