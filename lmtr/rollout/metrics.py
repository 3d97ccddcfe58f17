"""Obstacle avoidance and kinematic limits of one motion (Sec. 5.2).

They judge a :class:`~lmtr.trajectory.motion.Motion` among obstacle lines, whatever made it: a
rollout, or an expert solution as the line of reference.
"""

import numpy as np

from lmtr.arrays import Array
from lmtr.geometry.line import closest_distance, signed_distance
from lmtr.geometry.rotation import rotation_matrix
from lmtr.robot.model import N_FEET, RobotModel
from lmtr.trajectory.motion import Motion


def obstacle_clearances(motion: Motion, obstacles_W: Array) -> Array:
    """Distance of each foot's closest foothold to each line that the robot has crossed.

    A line counts as crossed when every foot stood first on one side of it and last on the other,
    so one that the hind feet have yet to step over does not count.

    Args:
        motion: A motion among the lines.
        obstacles_W: Lines (n, 3) in m and rad.

    Returns:
        (n_crossed, 4) in m, by line and foot.
    """
    holds = motion.footholds
    by_foot = []
    crossed = np.ones(len(obstacles_W), dtype=bool)
    for foot in range(N_FEET):
        mine = np.flatnonzero(holds.foot == foot)
        mine = mine[np.argsort(holds.touchdown[mine], kind="stable")]
        if len(mine) == 0:
            return np.zeros((0, N_FEET))
        distance = signed_distance(obstacles_W[:, None], holds.position_W[mine])
        crossed &= distance[:, 0] * distance[:, -1] < 0.0
        by_foot.append(closest_distance(obstacles_W, holds.position_W[mine]))
    return np.stack(by_foot, axis=-1)[crossed]


def forward_offset(motion: Motion, robot: RobotModel) -> Array:
    """Forward position of contacting feet relative to neutral, (M, 4) in m; NaN in swing.

    Forward is the base's own x axis, by its full rotation: pitch moves the feet's range along.
    """
    rotation = rotation_matrix(motion.base_rpy)
    from_base_W = motion.foot_position_W - motion.base_position_W[:, None]
    # The first column of R is the base's x axis in the world.
    forward = (from_base_W * rotation[:, None, :, 0]).sum(axis=-1)
    return np.where(motion.contact, forward - robot.nominal_feet_B[:, 0], np.nan)


def forward_violation(motion: Motion, robot: RobotModel, limit: float = 0.2) -> Array:
    """How far contacting feet are beyond ± ``limit`` (m) forward of or behind neutral.

    Returns:
        (M, 4) in m at the motion's samples; 0 inside the range, NaN in swing.
    """
    return np.maximum(np.abs(forward_offset(motion, robot)) - limit, 0.0)
