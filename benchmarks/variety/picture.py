"""Modes of a few tasks seen from above with two contrasting gaits, and modes of all by cost."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from benchmarks.variety.clusters import distances
from benchmarks.variety.summary import TaskModes
from lmtr.figures.gait_diagram import draw_gait, phase_key
from lmtr.figures.style import FULL_WIDTH, INK, OBSTACLE, series_styles, styled
from lmtr.robot.model import FEET
from lmtr.trajectory.motion import sampled

SHOWN = 3
"""Tasks that are drawn from above."""

SHOWN_MODES = 3
"""Modes of each, the cheapest."""

SHOWN_SHARE = 0.1
"""Cost over the best up to which a mode is drawn beside it."""

_SAMPLE_STEP = 0.02
_MARKERS = dict(zip(FEET, ("o", "s", "^", "D"), strict=True))
"""Feet by shape; colours are taken by the modes."""


@styled
def gallery(tasks: Sequence[TaskModes]) -> Figure:
    """Top views of the tasks with most modes about as good as the best, and two gaits of each."""
    chosen = sorted(tasks, key=lambda task: -len(near_best(task)))[:SHOWN]
    figure = Figure(figsize=(FULL_WIDTH, 3.3 * len(chosen)), layout="constrained")
    for part, task in zip(np.atleast_1d(figure.subfigures(len(chosen), 1)), chosen, strict=True):
        top, gaits = part.subfigures(1, 2, width_ratios=(1.25, 1.0))
        _draw_above(top.subplots(), task)
        pair = contrasting(task)
        panels = gaits.subplots(len(pair), 1, sharex=True, squeeze=False)[:, 0]
        for axes, mode in zip(panels, pair, strict=True):
            _draw_bars(axes, task, mode)
            axes.label_outer()
    figure.legend(handles=[*_foot_key(), *phase_key()], loc="outside lower center", ncols=6)
    return figure


@styled
def overview(tasks: Sequence[TaskModes]) -> Figure:
    """Modes of each task, with their costs and sizes."""
    ordered = sorted(tasks, key=lambda task: task.count)
    figure = Figure(figsize=(FULL_WIDTH, 5.2), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.0, 1.7))
    place = np.arange(len(ordered))
    several = [int((np.bincount(task.label) > 1).sum()) for task in ordered]
    upper.bar(place, [task.count for task in ordered], color="#BBBBBB", label="found once")
    upper.bar(place, several, color="#332288", label="found more than once")
    upper.set_ylabel("modes (count)")
    upper.set_title(f"Median {np.median([task.count for task in tasks]):g} modes per task")
    upper.legend(ncols=2)
    for x, task in zip(place, ordered, strict=True):
        _draw_costs(lower, float(x), task)
    lower.set_ylabel("cost over the task's best (%)")
    lower.set_xlabel("task (number)")
    lower.set_xticks(place, [str(task.index) for task in ordered])
    lower.set_title("Every mode: line from best to worst, area of the dot by the number of draws")
    return figure


def near_best(task: TaskModes) -> list[int]:
    """Modes that cost about as little as the best, cheapest first."""
    limit = (1.0 + SHOWN_SHARE) * task.costs.min()
    return [mode for mode, k in enumerate(task.best) if task.costs[k] <= limit][:SHOWN_MODES]


def contrasting(task: TaskModes) -> tuple[int, ...]:
    """The two modes about as good as the best whose contact times are furthest apart."""
    found = near_best(task)
    if len(found) < 2:
        return tuple(found)
    _, late = distances([task.walks[task.best[mode]] for mode in found])
    return tuple(
        found[k] for k in max(combinations(range(len(found)), 2), key=lambda pair: late[pair])
    )


def _draw_above(axes: Axes, task: TaskModes) -> None:
    found = near_best(task)
    styles = series_styles([str(mode) for mode in found])
    low, high = np.inf, -np.inf
    for mode in found:
        style, best = styles[str(mode)], task.walks[task.best[mode]]
        feet = best.trajectory.footholds[..., :2]
        low, high = min(low, feet[..., 1].min()), max(high, feet[..., 1].max())
        base = sampled(best.trajectory, _SAMPLE_STEP).base_position_W
        axes.plot(base[:, 0], base[:, 1], color=style.colour, linewidth=1.2, zorder=2.0)
        for foot, marker in zip(feet, _MARKERS.values(), strict=True):
            axes.plot(
                foot[:, 0],
                foot[:, 1],
                marker,
                color=style.colour,
                markerfacecolor="none",
                markersize=4.5,
                zorder=3.0,
            )
        over = task.costs[task.best[mode]] / task.costs.min() - 1.0
        axes.plot([], [], color=style.colour, label=f"mode {mode + 1}: +{100.0 * over:.1f} %")
    for x, y, alpha in task.walks[0].obstacles_W:
        axes.axline((x, y), slope=float(np.tan(alpha)), color=OBSTACLE, linewidth=2.2, zorder=1.0)
    axes.set_ylim(float(low) - 0.1, float(high) + 0.1)
    axes.set_aspect("equal")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.set_title(f"Task {task.index}: {len(found)} of {task.count} modes, cost over the best")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.3), ncols=SHOWN_MODES)


def _foot_key() -> list[Line2D]:
    return [
        Line2D([], [], color=INK, marker=marker, markerfacecolor="none", linestyle="", label=foot)
        for foot, marker in _MARKERS.items()
    ]


def _draw_bars(axes: Axes, task: TaskModes, mode: int) -> None:
    place = task.best[mode]
    look = task.characters[place]
    draw_gait(axes, sampled(task.walks[place].trajectory, _SAMPLE_STEP))
    first = ", ".join(order[0] for order in look.crossing_order)
    axes.set_title(
        f"Mode {mode + 1}: over the lines first {first}, {100 * look.two_feet:.0f} % on two feet",
        fontsize=9.0,
    )


def _draw_costs(axes: Axes, x: float, task: TaskModes) -> None:
    over = 100.0 * (task.costs / task.costs.min() - 1.0)
    for mode in task.modes:
        mine = over[task.members(mode)]
        here = x + 0.6 * ((mode + 0.5) / task.count - 0.5)
        axes.plot([here, here], [mine.min(), mine.max()], color="#999999", linewidth=1.0)
        axes.scatter(
            here, mine.min(), s=7.0 * len(mine), color="#332288", edgecolor=INK, zorder=3.0
        )
