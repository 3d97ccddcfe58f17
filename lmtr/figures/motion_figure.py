"""One motion on one sheet: the top view and the gait diagram of Fig. 3, and the base's state."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lmtr.arrays import Array
from lmtr.figures.gait_diagram import draw_gait, phase_key
from lmtr.figures.style import FULL_WIDTH, styled
from lmtr.figures.top_view import draw_top_view, ground_window, require_drawable, top_view_key
from lmtr.trajectory.motion import Motion

_GAIT_HEIGHT = 1.5
_STATE_HEIGHT = 1.15
_FRAME_WIDTH = 0.9
"""Width taken by labels beside the axes (in)."""


@styled
def motion_figure(
    motion: Motion,
    obstacles_W: Array,
    title: str,
    goal_pose_W: Array | None = None,
    potential_width: float | None = None,
    with_state: bool = False,
) -> Figure:
    """Top view over gait diagram (Fig. 3).

    Args:
        motion: A solution, a segment or a rollout.
        obstacles_W: Lines (n, 3): x, y (m) and direction (rad).
        title: Headline.
        goal_pose_W: Goal x, y (m) and yaw (rad), if there is one.
        potential_width: σ of the obstacle potential (m), to shade the ground by it.
        with_state: Whether to add base height, attitude and speed over time.

    Raises:
        DataError: The motion has fewer than two samples, or numbers that are not finite.
    """
    require_drawable(motion)
    window = ground_window(motion, goal_pose_W)
    view = float(np.clip((FULL_WIDTH - _FRAME_WIDTH) * window.height / window.width, 1.2, 5.5))
    heights = [view + 0.5, _GAIT_HEIGHT, *([_STATE_HEIGHT] * 3 if with_state else [])]
    figure = Figure(figsize=(FULL_WIDTH, sum(heights) + 1.0), layout="constrained")
    top, gait, *state = figure.subplots(len(heights), 1, height_ratios=heights)
    draw_top_view(top, motion, obstacles_W, goal_pose_W, potential_width)
    draw_gait(gait, motion)
    if state:
        _draw_state(state, motion)
    figure.align_ylabels()
    figure.suptitle(title, x=0.01, ha="left")
    handles = [*top_view_key(top), *phase_key()]
    figure.legend(
        handles=handles, loc="outside lower center", ncols=min(len(handles), 6), columnspacing=1.4
    )
    return figure


def _draw_state(axes: list[Axes], motion: Motion) -> None:
    """Base height, roll and pitch, and horizontal speed over time."""
    height, attitude, speed = axes
    height.plot(motion.times, motion.base_position_W[:, 2], color="black")
    height.set_ylabel("base\nheight (m)")
    low, high = motion.base_position_W[:, 2].min(), motion.base_position_W[:, 2].max()
    # A still base should look still: never less than 4 cm from bottom to top.
    spread = max(0.02, 0.6 * (high - low))
    height.set_ylim((low + high) / 2.0 - spread, (low + high) / 2.0 + spread)
    degrees = np.degrees(motion.base_rpy)
    attitude.plot(motion.times, degrees[:, 0], color="#332288", label="roll")
    attitude.plot(motion.times, degrees[:, 1], color="#CC6677", linestyle="--", label="pitch")
    largest = max(1.0, 1.5 * float(np.abs(degrees[:, :2]).max()))
    attitude.set_ylim(-largest, largest)
    attitude.set_ylabel("attitude\n(deg)")
    attitude.legend(loc="upper right", ncols=2)
    speed.plot(motion.times, np.linalg.norm(motion.base_velocity_W[:, :2], axis=-1), color="black")
    speed.set_ylim(bottom=0.0)
    speed.set_ylabel("speed\n(m/s)")
    for panel in axes:
        panel.set_xlim(float(motion.times[0]), float(motion.times[-1]))
        panel.set_xlabel("time (s)" if panel is speed else "")
        panel.label_outer()
