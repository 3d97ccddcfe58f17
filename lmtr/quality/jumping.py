"""Flight, vertical motion and landings: what tells a jump from a walk (Sec. 4.2).

The paper discards "energetic jumping" that hardware cannot execute. Contact flags alone do not
tell of it: a foot may be said to stand and bear nothing. So forces and the base's motion are
asked as well.
"""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from lmtr.arrays import Array
from lmtr.quality.residual import RigidMotion
from lmtr.robot.model import GRAVITY, N_FEET, RobotModel
from lmtr.trajectory.sample import FootSamples, sample_base, sample_each_foot
from lmtr.trajectory.trajectory import Trajectory

FREE_FALL = 0.1
"""Vertical force of all feet together (weights) below which the robot as good as falls."""

ENERGY_WINDOW = 0.5
"""Time within which mechanical energy may not swing (s): push-off and flight of a small jump."""

LANDING_TIME = 0.1
"""Time after a touch-down that counts as landing (s)."""

_LANDING_SAMPLES = 41
"""Samples of a landing, 2.5 ms apart: the shortest force piece lasts some 0.1 s."""


class Landings(NamedTuple):
    """Hardest landing of a motion, each figure by itself; zero without any touch-down.

    Attributes:
        force: Largest vertical force of a foot within ``LANDING_TIME`` of its touch-down (weights).
        rate: Fastest rise of that force (weights/s).
        speed: Fastest sinking of the base at a touch-down (m/s).
    """

    force: float
    rate: float
    speed: float


def support(feet: FootSamples, robot: RobotModel) -> Array:
    """Vertical force of all feet together, (M,) in weights."""
    return np.asarray(feet.force[..., 2].sum(axis=-1) / robot.weight)


def in_flight(feet: FootSamples, robot: RobotModel) -> Array:
    """Whether the robot flies, (M,) bool: no foot stands, or those that do bear next to nothing."""
    return np.asarray(~feet.contact.any(axis=-1) | (support(feet, robot) < FREE_FALL))


def vertical_energy_swing(motion: RigidMotion, dt: float) -> float:
    """Largest swing of the vertical motion's energy within ``ENERGY_WINDOW``, per weight (m).

    The energy z + ż²/2g is the height that the base would rise to if the legs let go of it, so a
    jump of height h swings by h or more, whether it is a high one or a quick one.
    """
    energy = motion.position[:, 2] + motion.velocity[:, 2] ** 2 / (2.0 * GRAVITY)
    samples = min(round(ENERGY_WINDOW / dt) + 1, len(energy))
    swing = maximum_filter1d(energy, samples) - minimum_filter1d(energy, samples)
    return float(swing.max())


def landings(trajectory: Trajectory, robot: RobotModel) -> Landings:
    """How hard the feet land, over all touch-downs."""
    touchdowns = trajectory.touchdown_times  # (4, S − 1)
    if not touchdowns.size:
        return Landings(0.0, 0.0, 0.0)
    sinking = -sample_base(trajectory, touchdowns.reshape(-1)).velocity[:, 2]
    since = np.linspace(0.0, LANDING_TIME, _LANDING_SAMPLES)
    times = (touchdowns[..., None] + since).reshape(N_FEET, -1)
    normal = sample_each_foot(trajectory, times).force[..., 2].T
    forces = normal.reshape(*touchdowns.shape, _LANDING_SAMPLES)
    rise = np.diff(forces, axis=-1) / (since[1] * robot.weight)
    return Landings(
        force=float(forces.max() / robot.weight),
        rate=max(0.0, float(rise.max())),
        speed=max(0.0, float(sinking.max())),
    )
