"""Newton's and Euler's equations of a trajectory, from nothing but its sampled motion.

Linear: m·r̈ = Σ f + m·g. Angular, about the centre of mass in world axes:
I_W·ω̇ + ω × I_W·ω = Σ (p − r) × f. Velocities, accelerations, ω and ω̇ are central differences of
positions and rotation matrices, so no derivative formula of the splines or angles is trusted.
"""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

from lmtr.arrays import Array
from lmtr.robot.model import GRAVITY, RobotModel
from lmtr.trajectory.sample import FootSamples, sample_base
from lmtr.trajectory.trajectory import Trajectory

DIFFERENCE_STEP = 1e-3
"""Step of the central differences (s); their error is below 0.01 m/s² and rad/s² at its square."""

DRIFT_HORIZON = 0.8
"""Time over which planned forces are integrated without feedback (s): a segment's duration."""


@dataclass(frozen=True)
class RigidMotion:
    """Motion of the base as a rigid body at M times, world frame.

    Attributes:
        position: (M, 3) in m.
        rpy: Roll, pitch, yaw, (M, 3) in rad.
        velocity: (M, 3) in m/s.
        acceleration: (M, 3) in m/s².
        rotation: Base to world, (M, 3, 3).
        omega: Angular velocity, (M, 3) in rad/s.
        omega_rate: Its time derivative, (M, 3) in rad/s².
    """

    position: Array
    rpy: Array
    velocity: Array
    acceleration: Array
    rotation: Array
    omega: Array
    omega_rate: Array


def rigid_motion(trajectory: Trajectory, times: Array) -> RigidMotion:
    """The base's motion by central differences at ``times`` (M,) in s."""
    step = DIFFERENCE_STEP
    around = times + step * np.array([[-1.0], [0.0], [1.0]])
    base = sample_base(trajectory, around.reshape(-1))
    position = base.position.reshape(3, -1, 3)
    rotation = Rotation.from_euler("ZYX", base.rpy[:, ::-1]).as_matrix().reshape(3, -1, 3, 3)
    spin = (rotation[2] - rotation[0]) / (2.0 * step)
    spin_rate = (rotation[2] - 2.0 * rotation[1] + rotation[0]) / step**2
    here = rotation[1].transpose(0, 2, 1)
    # Ṙ = [ω]×·R, so [ω]× = Ṙ·Rᵀ, and [ω̇]× is the skew part of R̈·Rᵀ.
    return RigidMotion(
        position=position[1],
        rpy=base.rpy.reshape(3, -1, 3)[1],
        velocity=(position[2] - position[0]) / (2.0 * step),
        acceleration=(position[2] - 2.0 * position[1] + position[0]) / step**2,
        rotation=rotation[1],
        omega=_axial(spin @ here),
        omega_rate=_axial(spin_rate @ here),
    )


def linear_residual(motion: RigidMotion, feet: FootSamples, robot: RobotModel) -> Array:
    """Acceleration that the forces leave unexplained, r̈ − Σf/m − g, (M, 3) in m/s²."""
    return motion.acceleration - _acceleration(feet, robot)


def angular_residual(motion: RigidMotion, feet: FootSamples, robot: RobotModel) -> Array:
    """Angular acceleration that the moments leave unexplained, in base axes, (M, 3) in rad/s²."""
    inertia_W = motion.rotation @ robot.inertia_B @ motion.rotation.transpose(0, 2, 1)
    momentum = _times(inertia_W, motion.omega)
    needed = _times(inertia_W, motion.omega_rate) + np.cross(motion.omega, momentum)
    arm = feet.position - motion.position[:, None, :]
    moment = np.cross(arm, feet.force).sum(axis=1)
    error_B = _times(motion.rotation.transpose(0, 2, 1), needed - moment)
    return np.asarray(np.linalg.solve(robot.inertia_B, error_B.T).T)


def open_loop_drift(motion: RigidMotion, feet: FootSamples, robot: RobotModel, dt: float) -> Array:
    """How far the base strays if the planned forces act on it without feedback.

    Args:
        motion: The planned motion every ``dt``.
        feet: Its contact forces at the same times.
        robot: Its mass.
        dt: Spacing of the samples (s).

    Returns:
        Distance to the plan ``DRIFT_HORIZON`` after each possible start, (K,) in m; of the whole
        motion if it is shorter than that.
    """
    velocity = cumulative_trapezoid(_acceleration(feet, robot), dx=dt, axis=0, initial=0.0)
    position = cumulative_trapezoid(velocity, dx=dt, axis=0, initial=0.0)
    ahead = min(round(DRIFT_HORIZON / dt), len(position) - 1)
    start, end = slice(None, -ahead), slice(ahead, None)
    horizon = ahead * dt
    simulated = position[end] - position[start] + (motion.velocity - velocity)[start] * horizon
    planned = motion.position[end] - motion.position[start]
    return np.asarray(np.linalg.norm(simulated - planned, axis=-1))


def _acceleration(feet: FootSamples, robot: RobotModel) -> Array:
    """Acceleration of the centre of mass by forces and gravity, (M, 3) in m/s²."""
    return np.asarray(feet.force.sum(axis=1) / robot.mass - np.array([0.0, 0.0, GRAVITY]))


def _times(matrices: Array, vectors: Array) -> Array:
    return np.asarray((matrices @ vectors[..., None])[..., 0])


def _axial(matrices: Array) -> Array:
    """The vector a of the skew part [a]× of matrices (..., 3, 3)."""
    skew = 0.5 * (matrices - matrices.transpose(0, 2, 1))
    return np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=-1)
