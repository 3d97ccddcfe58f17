"""Feet against the ground, their range of motion, their phases and the obstacle lines."""

import numpy as np

from lmtr.arrays import Array
from lmtr.geometry.line import closest_distance
from lmtr.quality.residual import RigidMotion
from lmtr.robot.model import RobotModel
from lmtr.trajectory.sample import FootSamples
from lmtr.trajectory.trajectory import Trajectory


def range_of_motion_overshoot(
    motion: RigidMotion, feet: FootSamples, robot: RobotModel
) -> tuple[float, float]:
    """How far feet leave their box in the base frame, in stance and in swing (m).

    The base frame is turned by the full rotation, and feet are where they are, in all three axes,
    as in the constraint that the expert holds at its samples (Sec. 4.1; TOWR's range of motion).
    One allowance is made: a foot that is lifted folds its leg, which legs can, so upwards the box
    of a swing foot grows by the lift. Downwards a leg can but stretch, so there it does not.
    """
    apart = feet.position - motion.position[:, None, :]
    apart_B = np.einsum("mij,mfi->mfj", motion.rotation, apart)
    offset = apart_B - robot.nominal_feet_B
    # Down, the foot itself may not be too far; up, the ground below it may not be too near.
    lift_B = feet.position[..., 2] * motion.rotation[:, None, 2, 2]
    vertical = np.maximum(-offset[..., 2], offset[..., 2] - lift_B)
    box = np.array(robot.range_of_motion)
    beyond = np.abs(offset) - box
    sideways = beyond[..., :2].max(axis=-1)
    stance = np.where(feet.contact, np.maximum(sideways, beyond[..., 2]), 0.0)
    swing = np.where(feet.contact, 0.0, np.maximum(sideways, vertical - box[2]))
    return _largest(stance), _largest(swing)


def stance_slip(feet: FootSamples) -> float:
    """Longest way (m) that a foot moves away from where it stood at a stance's first sample."""
    stance = np.where(feet.contact, feet.stance, -1).T  # (4, M), −1 in swing
    begins = np.flatnonzero(np.diff(stance, axis=-1, prepend=-2))  # of phases, foot after foot
    samples = np.diff(begins, append=stance.size)
    place = feet.position.T.reshape(3, -1)
    way = np.linalg.norm(place - np.repeat(place[:, begins], samples, axis=-1), axis=0)
    return _largest(way[stance.reshape(-1) >= 0])


def height_errors(feet: FootSamples) -> tuple[float, float]:
    """Largest distance of a stance foot to the ground, and depth of a swing foot below it (m)."""
    height = feet.position[..., 2]
    off_ground = np.where(feet.contact, np.abs(height), 0.0)
    below = np.where(feet.contact, 0.0, -height)
    return _largest(off_ground), _largest(below)


def phase_durations(trajectory: Trajectory) -> tuple[Array, Array]:
    """Durations of all stances (4, S) and swings (4, S − 1) in s."""
    durations = np.diff(trajectory.contact_times, axis=-1)
    return durations[:, 0::2], durations[:, 1::2]


def closest_footholds(trajectory: Trajectory, obstacles_W: Array) -> tuple[float, ...]:
    """Distance (m) of each obstacle line (n, 3) to its closest foothold, infinite without any.

    The start feet are given with the task, so they do not count.
    """
    return tuple(closest_distance(obstacles_W, trajectory.footholds[:, 1:]).tolist())


def _largest(excess: Array) -> float:
    """The largest entry, 0 if none is positive."""
    return max(0.0, float(excess.max(initial=0.0)))
