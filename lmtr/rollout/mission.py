"""The mission planner: a goal that always stays ahead on the world's x axis (Sec. 5.1)."""

import numpy as np

from lmtr.arrays import Array


def goal_ahead_W(base_x: Array, distance: float) -> Array:
    """Goal pose γ, x, y (m) and yaw (rad), of a robot whose base is at ``base_x``.

    The goal lies on the world's x axis and faces along it, so that a robot which has drifted
    sideways or turned is led back.

    Args:
        base_x: Position of the base along the world's x axis, (...) in m.
        distance: How far ahead of it the goal is put (m).

    Returns:
        Goal poses in the world frame, (..., 3).
    """
    goal: Array = np.zeros((*np.shape(base_x), 3))
    goal[..., 0] = base_x + distance
    return goal
