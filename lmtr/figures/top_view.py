"""The top view of Fig. 3: base path, footholds and obstacle lines on the ground."""

from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.patheffects import withStroke

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.figures.style import FOOT_COLOURS, INK, OBSTACLE
from lmtr.geometry.line import signed_distance
from lmtr.robot.model import FEET
from lmtr.trajectory.motion import Motion
from lmtr.trajectory.trajectory import BASE_STEP

MARGIN = 0.15
"""Ground shown around everything drawn (m)."""

LONG_MOTION = 10.0
"""From this duration (s) on, dots are small and times are written every 5 s instead of 1 s."""

_SHADE = LinearSegmentedColormap.from_list("potential", [(0.46, 0.46, 0.46, a) for a in (0, 0.55)])
_HALO = [withStroke(linewidth=2.5, foreground="white")]


@dataclass(frozen=True)
class GroundWindow:
    """The rectangle of ground that is shown, in m."""

    left: float
    right: float
    bottom: float
    top: float

    @property
    def width(self) -> float:
        """Extent along x (m)."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Extent along y (m)."""
        return self.top - self.bottom


def require_drawable(motion: Motion) -> None:
    """Refuse a motion of fewer than two samples or with numbers that are not finite.

    Raises:
        DataError: It is one of them.
    """
    if len(motion.times) < 2:
        raise DataError(
            f"figure of a motion: needs at least two samples, got {len(motion.times)}; "
            "sample it over a longer time"
        )
    arrays = (motion.base_position_W, motion.base_rpy, motion.foot_position_W)
    if not all(np.isfinite(array).all() for array in (*arrays, motion.footholds.position_W)):
        raise DataError(
            "figure of a motion: all positions must be finite, got NaN or infinity; "
            "cut the motion before it diverges"
        )


def ground_window(motion: Motion, goal_pose_W: Array | None = None) -> GroundWindow:
    """The ground under base path, footholds and goal, with a margin."""
    points = [motion.base_position_W[:, :2], motion.footholds.position_W]
    if goal_pose_W is not None:
        points.append(goal_pose_W[None, :2])
    ground = np.concatenate(points)
    low, high = ground.min(axis=0) - MARGIN, ground.max(axis=0) + MARGIN
    return GroundWindow(float(low[0]), float(high[0]), float(low[1]), float(high[1]))


def draw_top_view(
    axes: Axes,
    motion: Motion,
    obstacles_W: Array,
    goal_pose_W: Array | None = None,
    potential_width: float | None = None,
) -> None:
    """Draw base nodes as dots, footholds as crosses in their foot's colour, obstacles in grey.

    Args:
        axes: Where to draw.
        motion: The motion.
        obstacles_W: Lines (n, 3): x, y (m) and direction (rad).
        goal_pose_W: Goal x, y (m) and yaw (rad), if there is one.
        potential_width: Standard deviation σ (m) of the obstacles' Gaussian potential, to shade
            the ground by it; ``None`` for lines alone.
    """
    require_drawable(motion)
    window = ground_window(motion, goal_pose_W)
    _draw_obstacles(axes, window, obstacles_W, potential_width)
    _draw_footholds(axes, motion)
    _draw_base_path(axes, motion)
    _draw_pose(axes, motion.base_position_W[0, :2], motion.base_rpy[0, 2], "start", "white")
    if goal_pose_W is not None:
        _draw_pose(axes, goal_pose_W[:2], goal_pose_W[2], "goal", "#F0E442")
    axes.set_xlim(window.left, window.right)
    axes.set_ylim(window.bottom, window.top)
    axes.set_aspect("equal")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")


def top_view_key(axes: Axes) -> list[Artist]:
    """Legend entries of what ``draw_top_view`` drew on these axes, each once, in drawing order."""
    handles, labels = axes.get_legend_handles_labels()
    return list(dict(zip(labels, handles, strict=True)).values())


def _draw_obstacles(
    axes: Axes, window: GroundWindow, obstacles_W: Array, potential_width: float | None
) -> None:
    if len(obstacles_W) and potential_width is not None:
        columns = 600
        rows = max(2, round(columns * window.height / window.width))
        x = window.left + window.width * (np.arange(columns) + 0.5) / columns
        y = window.bottom + window.height * (np.arange(rows) + 0.5) / rows
        points = np.stack(np.meshgrid(x, y), axis=-1)
        distance = signed_distance(np.asarray(obstacles_W), points[..., None, :])
        potential = np.exp(-0.5 * (distance / potential_width) ** 2).max(axis=-1)
        axes.imshow(
            potential,
            extent=(window.left, window.right, window.bottom, window.top),
            origin="lower",
            cmap=_SHADE,
            vmin=0.0,
            vmax=1.0,
            zorder=0.5,
            interpolation="bilinear",
        )
        axes.fill_between(
            [], [], color="#B0B0B0", label=f"potential, σ = {100.0 * potential_width:.0f} cm"
        )
    for x0, y0, alpha in np.asarray(obstacles_W):
        axes.axline(
            (x0, y0),
            (x0 + np.cos(alpha), y0 + np.sin(alpha)),
            color=OBSTACLE,
            linewidth=2.2,
            zorder=1.0,
            label="obstacle line",
        )


def _draw_footholds(axes: Axes, motion: Motion) -> None:
    for row, foot in enumerate(FEET):
        mine = motion.footholds.position_W[motion.footholds.foot == row]
        axes.scatter(
            mine[:, 0],
            mine[:, 1],
            marker="x",
            s=38,
            linewidths=1.8,
            color=FOOT_COLOURS[foot],
            zorder=3.0,
            label=f"{foot} foothold",
        )


def _draw_base_path(axes: Axes, motion: Motion) -> None:
    """Dots every 0.1 s, so that their spacing shows the speed; times written along the path."""
    start, end = motion.times[0], motion.times[-1]
    nodes = start + BASE_STEP * np.arange(int(np.floor((end - start) / BASE_STEP + 1e-6)) + 1)
    x, y = (np.interp(nodes, motion.times, motion.base_position_W[:, k]) for k in (0, 1))
    axes.plot(
        x,
        y,
        ".",
        color="black",
        markersize=4.0 if len(nodes) <= LONG_MOTION / BASE_STEP else 2.4,
        zorder=4.0,
        label=f"base, every {BASE_STEP} s",
    )
    spacing = 1.0 if end - start <= LONG_MOTION else 5.0
    for time in np.arange(spacing, end - start + 1e-6, spacing):
        node = round(float(time) / BASE_STEP)
        axes.annotate(
            f"{time:.0f} s",
            (float(x[node]), float(y[node])),
            xytext=(0, 5),
            textcoords="offset points",
            ha="center",
            fontsize=8,
            color=INK,
            path_effects=_HALO,
            zorder=2.5,  # under the footholds: a label must not hide data
        )


def _draw_pose(axes: Axes, place: Array, yaw: float, name: str, colour: str) -> None:
    """An arrowhead that points along the pose's heading."""
    axes.plot(
        *place,
        marker=(3, 0, float(np.degrees(yaw)) - 90.0),
        linestyle="none",
        markersize=11,
        markerfacecolor=colour,
        markeredgecolor="black",
        zorder=4.5,
        label=name,
    )
