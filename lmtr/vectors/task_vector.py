"""The task vector x = (χ, η, γ) of 35 numbers (Sec. 4.3), the regressor's input."""

import numpy as np

from lmtr.arrays import Array
from lmtr.geometry.line import in_frame
from lmtr.geometry.se2 import SE2
from lmtr.robot.model import FEET
from lmtr.vectors.layout import N_LINES, TASK_LAYOUT
from lmtr.vectors.state import RobotState

KEPT_BEHIND = 0.5
"""A line counts until it is this far behind the base (m): the hind feet still have to cross it."""

DUMMY_AHEAD = 2.0
"""Distance ahead of the base (m) of the dummy that stands in for a missing line.

No foothold of a segment comes near it, so it steers nothing: in 4,800 windows of expert solutions
the furthest lay 1.3 m ahead of the base at the epoch.
"""

DUMMY_SPACING = 0.8
"""Distance (m) of a dummy behind the line or dummy before it: the mean spacing of real lines."""


def distance_ahead(lines_S: Array) -> Array:
    """Signed distance (m) of canonical lines (..., 3), positive ahead of the origin of _S.

    Measured along the line's normal that points along +x of _S; α in [0, π) makes that normal
    (sin α, −cos α).
    """
    alpha = lines_S[..., 2]
    return np.asarray(np.sin(alpha) * lines_S[..., 0] - np.cos(alpha) * lines_S[..., 1])


def next_lines(lines_W: Array, frame: SE2) -> Array:
    """The next two obstacle lines η, nearest first, in canonical form in the segment frame.

    A line counts until it is ``KEPT_BEHIND`` behind the base. Missing ones become dummies square
    to the x axis, at ``DUMMY_AHEAD`` or ``DUMMY_SPACING`` beyond the line before, whichever is
    further. Data and rollouts both come through here, so the rule is the same for both.

    Args:
        lines_W: (..., n, 3) or (n, 3) for all frames; n may be 0 and rows of NaN are no lines.
        frame: The segment frame (...) in the world.

    Returns:
        (..., 2, 3): x, y (m) and α (rad) in _S.
    """
    batch = np.shape(frame.x)
    lines_W = np.broadcast_to(lines_W, (*batch, *np.shape(lines_W)[-2:]))
    nothing = np.full((*batch, N_LINES, 3), np.nan)
    lines = np.concatenate([in_frame(lines_W, frame.over(1)), nothing], axis=-2)
    ahead = distance_ahead(lines)
    ahead = np.where(ahead >= -KEPT_BEHIND, ahead, np.inf)  # NaN compares false: no line
    order = np.argsort(ahead, axis=-1, kind="stable")[..., :N_LINES]
    chosen = np.take_along_axis(lines, order[..., None], axis=-2)
    distance = np.take_along_axis(ahead, order, axis=-1)
    previous = np.full(batch, -np.inf)
    for k in range(N_LINES):
        missing = np.isinf(distance[..., k])
        dummy = np.maximum(DUMMY_AHEAD, previous + DUMMY_SPACING)
        square = np.stack([dummy, np.zeros(batch), np.full(batch, np.pi / 2.0)], axis=-1)
        chosen[..., k, :] = np.where(missing[..., None], square, chosen[..., k, :])
        previous = np.where(missing, dummy, distance[..., k])
    return chosen


def encode_task(state: RobotState, lines_W: Array, goal_W: Array) -> Array:
    """The task vector of a state, the obstacle lines and a goal.

    Args:
        state: χ, batched (...).
        lines_W: Obstacle lines, (..., n, 3) or (n, 3), as for :func:`next_lines`.
        goal_W: x, y (m) and yaw (rad) of the goal pose γ, (..., 3).

    Returns:
        x, (..., 35).
    """
    goal = state.frame_W.invert() @ SE2.of(goal_W)
    parts = {
        "height": state.height,
        "roll_pitch": state.roll_pitch,
        "linear_velocity": state.linear_velocity_S,
        "angular_velocity": state.angular_velocity_S,
        "next_lines": next_lines(lines_W, state.frame_W),
        "goal_position": np.stack([goal.x, goal.y], axis=-1),
        "goal_heading": np.stack([np.cos(goal.yaw), np.sin(goal.yaw)], axis=-1),
    }
    for index, foot in enumerate(FEET):
        parts[f"{foot}_position"] = state.feet_S[..., index, :]
        parts[f"{foot}_time_since_liftoff"] = state.time_since_liftoff[..., index]
    return TASK_LAYOUT.pack(parts)
