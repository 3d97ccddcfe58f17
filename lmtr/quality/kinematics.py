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

    The base frame is turned by the full rotation. A swing foot is lifted on purpose, so its height
    is judged by the point of the ground below it, and x and y by the foot itself.
    """
    excess = _box_excess(motion, feet.position, robot)
    below = feet.position * np.array([1.0, 1.0, 0.0])
    lifted = np.concatenate([excess[..., :2], _box_excess(motion, below, robot)[..., 2:]], axis=-1)
    stance = np.where(feet.contact, excess.max(axis=-1), 0.0)
    swing = np.where(feet.contact, 0.0, lifted.max(axis=-1))
    return _largest(stance), _largest(swing)


def _box_excess(motion: RigidMotion, points_W: Array, robot: RobotModel) -> Array:
    """Excess of points (M, 4, 3) over the half sides of each foot's box, (M, 4, 3) in m."""
    points_B = (points_W - motion.position[:, None, :]) @ motion.rotation
    return np.asarray(np.abs(points_B - robot.nominal_feet_B) - np.array(robot.range_of_motion))


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
