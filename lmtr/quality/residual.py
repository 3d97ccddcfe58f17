"""Newton's and Euler's equations of a trajectory, from nothing but its sampled motion.

Linear: m·r̈ = Σ f + m·g. Angular, about the centre of mass in base axes:
I·ω̇ + ω × I·ω = Rᵀ·Σ (p − r) × f. Velocities, accelerations, ω and ω̇ are central differences of
positions and rotation matrices, so no derivative formula of the splines or angles is trusted; nor
is the expert's rotation matrix: here it is a product of three elementary turns.
"""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid

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
    around = times + DIFFERENCE_STEP * np.array([[-1.0], [0.0], [1.0]])
    base = sample_base(trajectory, around.reshape(-1))
    position, rpy = base.position.reshape(3, -1, 3), base.rpy.reshape(3, -1, 3)
    rotation = _rotation(base.rpy).reshape(3, -1, 3, 3)
    velocity, acceleration = _differences(position)
    # Ṙ = [ω]×·R, so ω = ½·Σ rₖ × ṙₖ over the base's axes rₖ, the columns of R; ω̇ likewise.
    axes = rotation.swapaxes(-1, -2)
    axes_rate, axes_second_rate = _differences(axes)
    return RigidMotion(
        position=position[1],
        rpy=rpy[1],
        velocity=velocity,
        acceleration=acceleration,
        rotation=rotation[1],
        omega=0.5 * _cross(axes[1], axes_rate).sum(axis=1),
        omega_rate=0.5 * _cross(axes[1], axes_second_rate).sum(axis=1),
    )


def linear_residual(motion: RigidMotion, feet: FootSamples, robot: RobotModel) -> Array:
    """Acceleration that the forces leave unexplained, r̈ − Σf/m − g, (M, 3) in m/s²."""
    return motion.acceleration - _acceleration(feet, robot)


def angular_residual(motion: RigidMotion, feet: FootSamples, robot: RobotModel) -> Array:
    """Angular acceleration that the moments leave unexplained, in base axes, (M, 3) in rad/s²."""
    arm = feet.position - motion.position[:, None, :]
    moment = _in_base_axes(motion, _cross(arm, feet.force).sum(axis=1))
    omega = _in_base_axes(motion, motion.omega)
    inertia = robot.inertia_B
    gyroscopic = _cross(omega, (inertia @ omega.T).T)
    unexplained = np.linalg.solve(inertia, (gyroscopic - moment).T).T
    return _in_base_axes(motion, motion.omega_rate) + unexplained


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


def _in_base_axes(motion: RigidMotion, vectors_W: Array) -> Array:
    """Vectors (M, 3) in world axes, seen in base axes."""
    return np.asarray(np.einsum("mij,mi->mj", motion.rotation, vectors_W))


def _rotation(rpy: Array) -> Array:
    """Base to world, (N, 3, 3), for roll, pitch, yaw (N, 3) in rad: about x, then y, then z.

    SciPy's rotations go by quaternions, which takes longer than all else that is measured.
    """
    rows = list(np.eye(3)[..., None])
    for angle, (first, second) in zip(rpy.T, ((1, 2), (2, 0), (0, 1)), strict=True):
        sine, cosine = np.sin(angle), np.cos(angle)
        rows[first], rows[second] = (
            cosine * rows[first] - sine * rows[second],
            sine * rows[first] + cosine * rows[second],
        )
    return np.moveaxis(np.array(rows), -1, 0)


def _differences(around: Array) -> tuple[Array, Array]:
    """First and second time derivative of values (3, ...) a step before, at and after."""
    before, at, after = around
    first = (after - before) / (2.0 * DIFFERENCE_STEP)
    second = (after - 2.0 * at + before) / DIFFERENCE_STEP**2
    return first, second


def _cross(a: Array, b: Array) -> Array:
    """Cross products a × b of vectors, both (..., 3)."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    product = np.empty_like(a)  # in memory as a is: np.cross turns it to slow rows of three
    product[..., 0] = ay * bz - az * by
    product[..., 1] = az * bx - ax * bz
    product[..., 2] = ax * by - ay * bx
    return product
