"""The filter's thresholds on the distributions that they cut, and what judging costs comes to."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.filtering.costs import POOR, Draws, Groups
from benchmarks.filtering.removal import Removal
from lmtr.figures.style import ACCEPTED, FULL_WIDTH, GUESS, INK, REJECTED, styled

_COLUMNS = 4
_BINS = 30
_ROW_HEIGHT = 2.1
"""Height of a row of distributions (in)."""

_RAW, _CONDITIONAL, _FILTERED = "#CC6677", "#332288", "#BBBBBB"

_MILLI = {"m": "mm"}
"""Units that are shown in thousandths."""


@styled
def thresholds_picture(
    found: Sequence[Removal],
    accepted: float,
    draws: Draws,
    difficulty: tuple[Groups, Groups],
    cost_excess: float,
) -> Figure:
    """Draw everything on one page.

    Args:
        found: Rules with their figures; those without a distribution are left out.
        accepted: Share of default tasks whose solutions are accepted.
        draws: Repeated solves of a few tasks.
        difficulty: What ways to judge costs remove by goal distance and by number of lines.
        cost_excess: Threshold on costs.
    """
    shown = [each for each in found if each.has_distribution]
    rows = -(-len(shown) // _COLUMNS)
    figure = Figure(figsize=(FULL_WIDTH, _ROW_HEIGHT * rows + 3.6), layout="constrained")
    top, bottom = figure.subfigures(2, 1, height_ratios=(_ROW_HEIGHT * rows, 3.6))
    panels = top.subplots(rows, _COLUMNS, squeeze=False).ravel()
    for axes in panels[len(shown) :]:
        axes.set_axis_off()
    for axes, removal in zip(panels, shown, strict=False):
        _draw_distribution(axes, removal)
    top.suptitle(
        f"{len(shown[0].values)} default tasks, {accepted:.0%} accepted. Above each figure: "
        "threshold, share beyond, (share refused for nothing else)",
        fontsize=10.0,
    )
    left, middle, right = bottom.subplots(1, 3)
    _draw_groups(left, difficulty[0], "goal distance (m)")
    _draw_groups(middle, difficulty[1], "obstacle lines (count)")
    left.set_title("Tasks refused")
    left.legend(fontsize=8.0)
    _draw_draws(right, draws, cost_excess)
    return figure


def _draw_distribution(axes: Axes, removal: Removal) -> None:
    rule = removal.rule
    unit, scale = _MILLI.get(rule.unit, rule.unit), 1000.0 if rule.unit in _MILLI else 1.0
    values = scale * removal.values[np.isfinite(removal.values)]
    limit = scale * removal.threshold
    # The threshold is an edge, so that no bin lies on both of its sides.
    low, high = min(values.min(), limit), max(values.max(), limit)
    width = (high - low) / _BINS
    below, above = np.ceil((limit - low) / width), np.ceil((high - limit) / width)
    edges = limit + width * np.arange(-below, above + 1.0)
    beyond = values < limit if rule.at_least else values > limit
    axes.hist([values[~beyond], values[beyond]], edges, stacked=True, color=[ACCEPTED, REJECTED])
    axes.axvline(limit, color=INK, linestyle="--", linewidth=1.2)
    axes.set_title(
        f"{limit:.3g}: {100 * removal.alone:.1f} % ({100 * removal.additional:.1f} %)",
        fontsize=9.0,
        fontweight="normal",
    )
    axes.set_xlabel(f"{rule.figure.replace('_', ' ')} ({unit})", fontsize=8.5)
    axes.tick_params(labelsize=7.5)
    axes.set_yticks([])


def _draw_groups(axes: Axes, groups: Groups, label: str) -> None:
    place, width = np.arange(len(groups.names)), 0.27
    for shares, offset, colour, name in (
        (groups.raw, -1.0, _RAW, "by the cost itself"),
        (groups.conditional, 0.0, _CONDITIONAL, "by its excess over what the task predicts"),
        (groups.filtered, 1.0, _FILTERED, "by the whole filter"),
    ):
        axes.bar(place + offset * width, 100.0 * np.array(shares), width, color=colour, label=name)
    names = [f"{n}\n{count} tasks" for n, count in zip(groups.names, groups.counts, strict=True)]
    axes.set_xticks(place, names, fontsize=7.5)
    axes.set_xlabel(label)
    axes.set_ylabel("refused (%)")
    axes.set_ylim(0.0, 100.0)


def _draw_draws(axes: Axes, draws: Draws, cost_excess: float) -> None:
    refused = draws.over_expected > cost_excess
    for flags, colour, name in ((~refused, ACCEPTED, "accepted"), (refused, REJECTED, "refused")):
        axes.scatter(
            100.0 * draws.over_expected[flags],
            100.0 * draws.over_best[flags],
            s=12.0,
            color=colour,
            label=name,
        )
    axes.axvline(100.0 * cost_excess, color=INK, linestyle="--", linewidth=1.2)
    axes.axhline(100.0 * POOR, color=GUESS, linewidth=1.0)
    axes.set_xlabel("cost over what the task predicts (%)")
    axes.set_ylabel("cost over the task's best draw (%)")
    axes.set_title(f"Draws of the same tasks: r = {draws.correlation:.2f}")
    axes.legend(fontsize=8.0)
