"""A motion at a few times side by side, as in Fig. 5."""

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from lmtr.arrays import Array
from lmtr.errors import ConfigurationError
from lmtr.figures.scene import ASPECT, Camera, Scene, sample_at, scene_key
from lmtr.figures.style import FULL_WIDTH, styled
from lmtr.figures.top_view import require_drawable
from lmtr.robot.model import RobotModel
from lmtr.trajectory.motion import Motion

COLUMNS = 3
"""Snapshots in one row."""


@styled
def snapshots(
    motion: Motion,
    obstacles_W: Array,
    robot: RobotModel,
    times: ArrayLike,
    title: str = "",
    camera: Camera | None = None,
) -> Figure:
    """Base, legs, forces and limits at the given times.

    Args:
        motion: A solution, a segment or a rollout.
        obstacles_W: Lines (n, 3): x, y (m) and direction (rad).
        robot: The robot that moves.
        times: When (s); the nearest samples are shown.
        title: Headline.
        camera: View; by default from the robot's right, a little from above.

    Raises:
        ConfigurationError: No times are given.
        DataError: The motion has fewer than two samples, or numbers that are not finite.
    """
    require_drawable(motion)
    when = np.atleast_1d(np.asarray(times, dtype=float))
    if not len(when):
        raise ConfigurationError("snapshots: at least one time is needed, got none; name some")
    scene = Scene(motion, obstacles_W, robot, camera or Camera())
    columns = min(COLUMNS, len(when))
    rows = -(-len(when) // columns)
    height = FULL_WIDTH / ASPECT / columns * rows + 0.95
    figure = Figure(figsize=(FULL_WIDTH, height))
    figure.subplots_adjust(0.01, 0.55 / height, 0.99, 1.0 - 0.4 / height, 0.02, 0.02)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in panels:
        axes.set_axis_off()
    for axes, time in zip(panels, when.tolist(), strict=False):
        sample = sample_at(motion, time)
        scene.draw(axes, sample, motion.base_position_W[sample, :2])
        axes.text(0.03, 0.93, f"t = {motion.times[sample]:.2f} s", transform=axes.transAxes)
    figure.suptitle(title, x=0.01, y=1.0 - 0.1 / height, ha="left", va="top")
    figure.legend(handles=scene_key(robot), loc="lower center", ncols=5, columnspacing=1.4)
    return figure
