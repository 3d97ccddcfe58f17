"""Feet against the ground, their range of motion, their phases and the obstacle lines."""

import numpy as np

from lmtr.arrays import Array
from lmtr.geometry.line import closest_distance
from lmtr.quality.residual import RigidMotion
from lmtr.robot.model import N_FEET, RobotModel
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
    offset = _offset(motion, feet.position, robot)
    ground = _offset(motion, feet.position * np.array([1.0, 1.0, 0.0]), robot)
    # Down, the foot itself may not be too far; up, the ground below it may not be too near.
    vertical = np.maximum(-offset[..., 2], ground[..., 2])
    lifted = np.concatenate([np.abs(offset[..., :2]), vertical[..., None]], axis=-1)
    box = np.array(robot.range_of_motion)
    stance = np.where(feet.contact, (np.abs(offset) - box).max(axis=-1), 0.0)
    swing = np.where(feet.contact, 0.0, (lifted - box).max(axis=-1))
    return _largest(stance), _largest(swing)


def _offset(motion: RigidMotion, points_W: Array, robot: RobotModel) -> Array:
    """Offsets of points (M, 4, 3) from each foot's neutral position, base frame, (M, 4, 3) in m."""
    points_B = (points_W - motion.position[:, None, :]) @ motion.rotation
    return np.asarray(points_B - robot.nominal_feet_B)


def stance_slip(feet: FootSamples) -> float:
    """Longest way (m) that a foot moves away from where it stood at a stance's first sample."""
    longest = 0.0
    for foot in range(N_FEET):
        stands = feet.contact[:, foot]
        stance, place = feet.stance[stands, foot], feet.position[stands, foot]
        _, first, inverse = np.unique(stance, return_index=True, return_inverse=True)
        longest = max(longest, _largest(np.linalg.norm(place - place[first][inverse], axis=-1)))
    return longest


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
