"""Which plans and motions a rollout can go on from; all others are counted as diverged."""

import numpy as np

from lmtr.arrays import Array, Flags
from lmtr.geometry.se2 import SE2
from lmtr.robot.model import RobotModel
from lmtr.rollout.record import Ending
from lmtr.rollout.settings import PlausibleRange
from lmtr.rollout.window import Samples

LARGEST_ENTRY = 1e6
"""Greatest magnitude of any entry of τ (SI units); contact forces and their rates stay 100 times
below it."""


def legible(tau: Array) -> Flags:
    """Whether segment vectors (n, 264) are finite and of a sane magnitude, (n,)."""
    # A comparison with NaN is false.
    return np.asarray((np.abs(tau) < LARGEST_ENTRY).all(axis=-1))


def judged(samples: Samples, plausible: PlausibleRange, robot: RobotModel) -> list[Ending]:
    """The ending of each of n motions: completed, or the first limit that it leaves."""
    height = samples.base_position_W[..., 2] / robot.nominal_height
    tilt = np.abs(samples.base_rpy[..., :2]).max(axis=-1)
    speed = np.sqrt((samples.base_velocity_W**2).sum(axis=-1))
    reach = _foot_offset(samples, robot).max(axis=-1)
    low, high = plausible.height
    outside = {
        Ending.BASE_HEIGHT: (height < low) | (height > high),
        Ending.TILT: tilt > plausible.tilt,
        Ending.SPEED: speed > plausible.speed,
        Ending.FOOT_OFFSET: reach > plausible.foot_offset,
    }
    leaves = np.stack([at_times.any(axis=1) for at_times in outside.values()], axis=-1)
    reasons = list(outside)
    return [reasons[int(np.argmax(left))] if left.any() else Ending.COMPLETED for left in leaves]


def _foot_offset(samples: Samples, robot: RobotModel) -> Array:
    """Horizontal distance of the feet from neutral, under the base's yaw, (n, S, 4) in m."""
    base, yaw = samples.base_position_W, samples.base_rpy[..., 2]
    frame = SE2(base[..., 0], base[..., 1], yaw)
    feet = frame.over(1).invert().apply(samples.foot_position_W)
    offset = feet[..., :2] - robot.nominal_feet_B[:, :2]
    return np.asarray(np.sqrt((offset**2).sum(axis=-1)))
