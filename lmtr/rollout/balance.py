"""Forces of a sampled motion: what they leave unexplained of it, and whether friction holds them.

Both look at samples alone and so judge rollouts, whose forces are planned and whose base moves as
it was accumulated, in the same way as expert solutions. Nothing here knows the expert: momenta are
differences of sampled velocities, and neither its balance nor its splines are used.
"""

import numpy as np

from lmtr.arrays import Array
from lmtr.geometry.rotation import rotation_matrix
from lmtr.robot.model import GRAVITY, RobotModel
from lmtr.trajectory.motion import Motion

SAME_SPACING = 1e-6
"""Samples (s) closer than this to even spacing are evenly spaced."""


def mean_residuals(motion: Motion, robot: RobotModel) -> tuple[Array, Array]:
    """Magnitudes of the acceleration and angular acceleration that forces leave unexplained.

    Around each sample k, with samples h apart, the change of momentum from k − 1 to k + 1 is held
    against the mean of forces and gravity in between, by Simpson's rule:
    (v₊ − v₋)/2h − F̄/m, and in base axes I⁻¹·Rᵀ·[(L₊ − L₋)/2h − M̄], with the angular momentum
    L = R·I·Rᵀ·ω about the centre of mass and moments M = Σ (p − r) × f. A jump of velocity at a
    replanning is a change of momentum that no force explains, and counts.

    Args:
        motion: M samples; the last may be closer to the one before it, and is left out then.
        robot: Mass and inertia.

    Returns:
        Two arrays (K,), K ≤ M − 2: m/s² and rad/s².
    """
    steps = np.diff(motion.times)
    if len(steps) < 2:
        return np.zeros(0), np.zeros(0)
    even = np.abs(steps - steps[0]) < SAME_SPACING
    inside = even[:-1] & even[1:]
    span = 2.0 * steps[0]
    weight_W = np.array([0.0, 0.0, GRAVITY])
    force = motion.foot_force_W.sum(axis=1) / robot.mass - weight_W
    linear = (motion.base_velocity_W[2:] - motion.base_velocity_W[:-2]) / span - _mean(force)

    rotation = rotation_matrix(motion.base_rpy)
    omega_B = np.einsum("mij,mi->mj", rotation, motion.base_angular_velocity_W)
    momentum = np.einsum("mij,mj->mi", rotation, omega_B @ robot.inertia_B.T)
    arm = motion.foot_position_W - motion.base_position_W[:, None]
    moment = np.cross(arm, motion.foot_force_W).sum(axis=1)
    unexplained_W = (momentum[2:] - momentum[:-2]) / span - _mean(moment)
    unexplained_B = np.einsum("mij,mi->mj", rotation[1:-1], unexplained_W)
    angular = np.linalg.solve(robot.inertia_B, unexplained_B.T).T
    return _magnitude(linear[inside]), _magnitude(angular[inside])


def friction_excess(motion: Motion, robot: RobotModel) -> Array:
    """How far planned forces of standing feet are outside of the friction pyramid.

    The larger of what they push sideways beyond μ·f_z, and what they pull at the ground.

    Args:
        motion: M samples; the ground is level.
        robot: Its weight, and the coefficient μ of the friction pyramid.

    Returns:
        (M, 4) in weights of the robot; 0 inside of the pyramid, NaN in swing.
    """
    force = motion.foot_force_W / robot.weight
    normal, sideways = force[..., 2], np.abs(force[..., :2]).max(axis=-1)
    slides = np.maximum(sideways - robot.friction * np.maximum(normal, 0.0), 0.0)
    return np.asarray(np.maximum(slides, pull(motion, robot)))


def pull(motion: Motion, robot: RobotModel) -> Array:
    """How much standing feet pull at the ground, (M, 4) in weights; 0 if not, NaN in swing."""
    normal = motion.foot_force_W[..., 2] / robot.weight
    return np.where(motion.contact, np.maximum(-normal, 0.0), np.nan)


def _mean(values: Array) -> Array:
    """Means over the two steps around each inner sample, by Simpson's rule."""
    return np.asarray((values[:-2] + 4.0 * values[1:-1] + values[2:]) / 6.0)


def _magnitude(vectors: Array) -> Array:
    return np.asarray(np.linalg.norm(vectors, axis=-1))
