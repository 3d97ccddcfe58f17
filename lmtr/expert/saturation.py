"""Limits of the problem that a solution lies on.

Friction, range of motion, pushing feet and the shortest phases are the robot's: solutions lie on
them as they should (half of all swings take no longer than they must, since feet on the ground
share the load). The other limits only fence the problem in; a solution that leans on one of them
is shaped by an arbitrary number.
"""

import numpy as np

from lmtr.arrays import Array
from lmtr.expert.settings import ExpertSettings
from lmtr.expert.timing import Windows
from lmtr.quality.kinematics import phase_durations
from lmtr.robot.model import RobotModel
from lmtr.trajectory.nodes import HEIGHT, SWING_POSITION, TILT, VALUE
from lmtr.trajectory.trajectory import Trajectory

NEARNESS = 0.01
"""Distance to a limit, as a share of its range, at which a solution lies on it: an interior point
stops that much short of limits that cost it little."""

WINDOW = "window"
"""Name of the limit on contact times."""


def saturated(
    trajectory: Trajectory,
    order: tuple[int, ...],
    windows: Windows,
    robot: RobotModel,
    settings: ExpertSettings,
) -> tuple[str, ...]:
    """Names of the limits that a solution lies on, those of ``Limits`` with what they bound.

    Args:
        trajectory: The solution.
        order: Feet by slot.
        windows: Nominal contact times by slot.
        robot: Its nominal height and weight.
        settings: The limits.
    """
    limits = settings.limits
    base = trajectory.base_nodes[:, VALUE]
    swing_height = trajectory.swing_nodes[..., SWING_POSITION][..., 2]
    force = trajectory.force_nodes[..., VALUE, 2] / robot.weight
    stances, swings = phase_durations(trajectory)
    times = trajectory.contact_times[list(order), 1:-1]
    low, high = limits.swing_height
    middle, reach = 0.5 * (low + high), 0.5 * (high - low)
    touched = {
        "height": _beyond(np.abs(base[:, HEIGHT] - robot.nominal_height), limits.height),
        "tilt": _beyond(np.abs(base[:, TILT]), limits.tilt),
        "force": _beyond(force, limits.force),
        "swing_height": _beyond(np.abs(swing_height - middle), reach),
        "longest_swing": _beyond(swings, limits.swing[1]),
        "longest_stance": _beyond(stances[:, 1:-1], limits.stance[1]),
        WINDOW: _beyond(np.abs(times - windows.nominal[:, 1:-1]), limits.window),
    }
    return tuple(name for name, touches in touched.items() if touches)


def _beyond(values: Array, limit: float) -> bool:
    """Whether any of the values, counted from zero, lies on its upper limit."""
    return bool((values > (1.0 - NEARNESS) * limit).any())
