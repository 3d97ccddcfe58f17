"""Segments that a regressor makes of one task in several modes, seen from above (Fig. 2 f)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.figures.style import FOOT_COLOURS, FULL_WIDTH, INK, OBSTACLE, styled
from lmtr.robot.model import FEET
from lmtr.trajectory.nodes import GROUND_POSITION
from lmtr.trajectory.sample import sample_base
from lmtr.trajectory.trajectory import Trajectory

COLUMNS = 3
"""Panels in one row, at most."""

MARGIN = 0.12
"""Ground shown around the footholds (m)."""

PATH_POINTS = 17
"""Points of a base's path."""


@dataclass(frozen=True)
class Strategies:
    """What one task may become.

    Attributes:
        title: What the panel shows.
        lines_S: Obstacle lines of the task, (n, 3): x, y (m) and direction (rad).
        segments: Batch (k) of segments, one per mode.
        colour: Colour of the title, such as that of the modes in another figure.
    """

    title: str
    lines_S: Array
    segments: Trajectory
    colour: str = INK


@styled
def strategies_figure(panels: Sequence[Strategies]) -> Figure:
    """One panel per task: where the segments of all of its modes put base and feet.

    Open circles are the feet's present footholds, crosses the next ones; both are joined, and
    black lines are the paths of the base.

    Args:
        panels: The tasks.

    Raises:
        DataError: There is no panel, or one has numbers that are not finite.
    """
    if not panels:
        raise DataError("strategies figure: needs at least one task, got none; choose some")
    for panel in panels:
        if not np.isfinite(panel.segments.footholds).all():
            raise DataError(
                f"strategies figure: footholds of {panel.title!r} must be finite; leave it out"
            )
    rows = -(-len(panels) // COLUMNS)
    columns = min(COLUMNS, len(panels))
    window = _window(panels)
    width = FULL_WIDTH / columns - 0.55
    view = width * (window[3] - window[2]) / (window[1] - window[0])
    figure = Figure(figsize=(FULL_WIDTH, (view + 0.85) * rows + 0.45), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    for axes in grid.ravel()[len(panels) :]:
        axes.set_axis_off()
    for axes, panel in zip(grid.ravel(), panels, strict=False):
        _draw(axes, panel)
        axes.set_xlim(*window[:2])
        axes.set_ylim(*window[2:])
        axes.set_aspect("equal")
        axes.set_title(panel.title, color=panel.colour, fontsize=9.5)
    for axes in grid[-1]:
        axes.set_xlabel("x (m)")
    for axes in grid[:, 0]:
        axes.set_ylabel("y (m)")
    figure.legend(handles=_key(), loc="outside lower center", ncols=8, columnspacing=1.3)
    return figure


def _window(panels: Sequence[Strategies]) -> tuple[float, float, float, float]:
    """Left, right, bottom and top of the ground under all footholds (m)."""
    places = [panel.segments.footholds[..., GROUND_POSITION] for panel in panels]
    feet = np.concatenate([each.reshape(-1, 2) for each in places])
    (left, bottom), (right, top) = feet.min(axis=0) - MARGIN, feet.max(axis=0) + MARGIN
    return float(left), float(right), float(bottom), float(top)


def _draw(axes: Axes, panel: Strategies) -> None:
    for x, y, alpha in np.asarray(panel.lines_S):
        axes.axline(
            (x, y), (x + np.cos(alpha), y + np.sin(alpha)), color=OBSTACLE, lw=2.4, zorder=1.0
        )
    footholds = panel.segments.footholds[..., GROUND_POSITION]
    faint = float(np.clip(6.0 / len(footholds), 0.25, 0.9))
    for number, foot in enumerate(FEET):
        colour = FOOT_COLOURS[foot]
        first, last = footholds[:, number, 0], footholds[:, number, -1]
        for begin, end in zip(first, last, strict=True):
            axes.plot(*np.stack([begin, end]).T, color=colour, lw=1.0, alpha=faint, zorder=2.0)
        axes.plot(*first.mean(axis=0), "o", mfc="white", mec=colour, ms=7, zorder=3.0)
        axes.plot(*last.T, "x", color=colour, ms=7, mew=1.7, alpha=0.85, zorder=3.0, label=foot)
    times = np.linspace(panel.segments.base_start, panel.segments.base_end, PATH_POINTS, axis=-1)
    for path in sample_base(panel.segments, times).position[..., GROUND_POSITION]:
        axes.plot(*path.T, color="black", lw=1.1, alpha=max(faint, 0.4), zorder=2.5)


def _key() -> list[Line2D]:
    feet = [
        Line2D([], [], color=FOOT_COLOURS[foot], marker="x", mew=1.7, lw=1.0, label=f"{foot} step")
        for foot in FEET
    ]
    return [
        *feet,
        Line2D([], [], ls="", marker="o", mfc="white", mec=INK, label="present foothold"),
        Line2D([], [], ls="", marker="x", color=INK, mew=1.7, label="next foothold"),
        Line2D([], [], color="black", lw=1.1, label="base"),
        Line2D([], [], color=OBSTACLE, lw=2.4, label="obstacle line"),
    ]
