"""Residuals against motions whose balance is known in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lmtr.geometry.rotation import angular_velocity_W, rate_rows, rate_rows_derivative
from lmtr.quality.residual import (
    angular_residual,
    linear_residual,
    open_loop_drift,
    rigid_motion,
)
from lmtr.robot.model import ANYMAL, GRAVITY
from lmtr.trajectory.sample import sample_base, sample_feet
from lmtr.trajectory.trajectory import FORCE_PIECES, Trajectory

END = 1.5
DT = 0.005
TIMES = DT * np.arange(round(END / DT) + 1)
INERTIA = ANYMAL.inertia_B


def at_rest(t):
    return np.zeros(6)


def quarter_each(t):
    return np.tile([0.0, 0.0, ANYMAL.weight / 4.0], (4, 1))


def standing(base=at_rest, force=quarter_each):
    """Four feet on the ground for 1.5 s.

    ``base(t)`` adds to position (m) and roll, pitch, yaw (rad), ``force(t)`` gives the feet's
    forces in N; both at most quadratic in time, so that Hermite nodes hold them exactly.
    """

    def node(function, t):
        return np.stack([function(t), (function(t + 0.01) - function(t - 0.01)) / 0.02])

    height = np.array([0.0, 0.0, ANYMAL.nominal_height, 0.0, 0.0, 0.0])
    ends = np.linspace(0.0, END, FORCE_PIECES + 1)
    return Trajectory(
        base_start=np.array(0.0),
        base_nodes=np.stack([node(lambda t: height + base(t), 0.1 * k) for k in range(16)]),
        contact_times=np.tile([0.0, END], (4, 1)),
        footholds=(ANYMAL.nominal_feet_B * np.array([1.0, 1.0, 0.0]))[:, None],
        swing_nodes=np.zeros((4, 0, 5)),
        force_nodes=np.moveaxis(np.stack([node(force, t) for t in ends]), 2, 0)[:, None],
    )


def residuals(trajectory):
    base, feet = rigid_motion(trajectory, TIMES), sample_feet(trajectory, TIMES)
    return linear_residual(base, feet, ANYMAL), angular_residual(base, feet, ANYMAL)


def test_a_static_stand_is_balanced():
    linear, angular = residuals(standing())
    assert linear == pytest.approx(0.0, abs=1e-7)
    assert angular == pytest.approx(0.0, abs=1e-7)


def test_support_behind_the_base_pitches_it_down():
    linear, angular = residuals(standing(lambda t: np.array([0.05, 0.0, 0.0, 0.0, 0.0, 0.0])))
    assert linear == pytest.approx(0.0, abs=1e-7)
    # Forces act 5 cm behind the centre of mass: their moment is about +y, nose down. The base
    # does not turn, so the residual is minus what they would do.
    nose_down = np.linalg.solve(INERTIA, [0.0, 0.05 * ANYMAL.weight, 0.0])
    assert angular == pytest.approx(np.tile(-nose_down, (len(TIMES), 1)), abs=1e-7)


def test_uniform_acceleration_is_balanced_by_shifting_weight_to_the_hind_feet():
    a, lever, h = 0.8, ANYMAL.nominal_forward, ANYMAL.nominal_height

    def force(t):
        forces = quarter_each(t)
        forces[:, 0] = ANYMAL.mass * a / 4.0
        # Moment about the moving base: fore minus hind load times lever = m(g·x − h·a).
        shift = ANYMAL.mass * (GRAVITY * 0.5 * a * t**2 - h * a) / (4.0 * lever)
        forces[:, 2] += shift * np.array([1.0, 1.0, -1.0, -1.0])
        return forces

    moving = standing(lambda t: np.array([0.5 * a * t**2, 0.0, 0.0, 0.0, 0.0, 0.0]), force)
    linear, angular = residuals(moving)
    assert linear == pytest.approx(0.0, abs=1e-6)
    assert angular == pytest.approx(0.0, abs=1e-6)


def test_a_missing_force_shows_with_its_size():
    def light(t):
        return 0.9 * quarter_each(t)

    linear, _ = residuals(standing(force=light))
    assert linear == pytest.approx(np.tile([0.0, 0.0, 0.1 * GRAVITY], (len(TIMES), 1)), abs=1e-7)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_spinning_up_about_an_axis_needs_eulers_moment(axis):
    spin_up = 0.3
    turning = np.zeros(6)
    turning[3 + axis] = 1.0
    linear, angular = residuals(standing(lambda t: 0.5 * spin_up * t**2 * turning))
    assert linear == pytest.approx(0.0, abs=1e-7)
    # In body axes: ω̇ + I⁻¹(ω × Iω), with products of inertia coupling the axes.
    omega = spin_up * TIMES[:, None] * np.eye(3)[axis]
    gyroscopic = np.linalg.solve(INERTIA, np.cross(omega, omega @ INERTIA.T).T).T
    assert angular == pytest.approx(spin_up * np.eye(3)[axis] + gyroscopic, abs=1e-6)


def test_angular_velocity_and_its_rate_agree_with_the_rates_of_roll_pitch_yaw(walk):
    trajectory = walk(1).trajectory
    times = 0.05 + np.arange(0.3, 7.0, 0.1)  # between knots, where the third derivative is smooth
    motion, base = rigid_motion(trajectory, times), sample_base(trajectory, times)
    assert motion.omega == pytest.approx(angular_velocity_W(base.rpy, base.rpy_rate), abs=1e-5)
    for k, (rpy, rate, second) in enumerate(
        zip(base.rpy, base.rpy_rate, base.rpy_acceleration, strict=True)
    ):
        change = np.array(rate_rows(rpy[1], rpy[2], np)) @ second
        change += np.array(rate_rows_derivative(rpy[1], rpy[2], rate[1], rate[2], np)) @ rate
        assert motion.omega_rate[k] == pytest.approx(change, abs=1e-4)


def test_the_base_is_turned_as_scipy_turns_it(walk):
    turning = np.array([[0.3, -0.2, 2.5], [-0.1, 0.4, -3.0]])
    trajectory = walk(1).trajectory
    nodes = trajectory.base_nodes.copy()
    nodes[:, 0, 3:] += np.linspace(*turning, len(nodes))
    motion = rigid_motion(replace(trajectory, base_nodes=nodes), TIMES)
    expected = Rotation.from_euler("ZYX", motion.rpy[:, ::-1]).as_matrix()
    assert motion.rotation == pytest.approx(expected, abs=1e-14)


def test_drift_is_half_the_unexplained_acceleration_times_time_squared():
    def pushed(t):
        forces = quarter_each(t)
        forces[:, 1] = ANYMAL.mass * 0.2 / 4.0
        return forces

    trajectory = standing(force=pushed)
    base, feet = rigid_motion(trajectory, TIMES), sample_feet(trajectory, TIMES)
    drift = open_loop_drift(base, feet, ANYMAL, DT)
    assert drift == pytest.approx(0.5 * 0.2 * 0.8**2, abs=1e-6)
    assert len(drift) == round((END - 0.8) / DT) + 1
