"""How many times milder one replanner violates than another, along the whole trade-off."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lmtr.errors import DataError
from lmtr.figures.style import FULL_WIDTH, SeriesStyle, Styles, styled, styles_for
from lmtr.figures.sweep import log_axis
from lmtr.rollout.comparison import AtLevel

Curve = Sequence[AtLevel]
"""Two replanners at several levels of avoidance."""

BEYOND = 1e9
"""Where a band ends that has no upper end."""


@styled
def front_ratio_figure(
    panels: Mapping[str, Mapping[str, Curve]],
    targets: Sequence[float] = (5.0, 10.0),
    styles: Styles | None = None,
) -> Figure:
    """One panel per measure of violation, one curve per pair of replanners.

    A large triangle marks a ratio that is a lower bound, its denominator being too rare to be told
    from nothing; an arrow at the bottom a ratio of zero, and at the top one of infinity.

    Args:
        panels: By measure, such as ``mean violation``, the curves by name of the pair.
        targets: Ratios to reach, drawn as dashed lines.
        styles: Styles of the pairs, if other figures show them too.

    Raises:
        DataError: There is no curve with a finite ratio.
    """
    finite = [
        np.isfinite(at.ratio.value)
        for curves in panels.values()
        for curve in curves.values()
        for at in curve
    ]
    if not any(finite):
        raise DataError(
            "ratio figure: needs a curve with a finite ratio, got none; evaluate two replanners "
            "whose fronts overlap"
        )
    names = list(dict.fromkeys(name for curves in panels.values() for name in curves))
    styles = styles_for(names, styles)
    figure = Figure(figsize=(FULL_WIDTH, 4.0), layout="constrained")
    grid = figure.subplots(1, len(panels), squeeze=False, sharey=True)[0]
    for number, (axes, (measure, curves)) in enumerate(zip(grid, panels.items(), strict=True)):
        for name, curve in curves.items():
            _draw(axes, curve, name, styles[name])
        for target in targets:
            axes.axhline(target, color="#444444", linestyle=(0, (2, 2)), lw=1.0, zorder=0.6)
            axes.annotate(
                f"{target:g}×",
                (1.0, target),
                xycoords=("axes fraction", "data"),
                xytext=(3, 0),
                textcoords="offset points",
                va="center",
                fontsize=9,
                color="#444444",
                annotation_clip=False,
            )
        axes.axhline(1.0, color="#999999", lw=0.9, zorder=0.5)
        axes.set_title(f"({chr(ord('a') + number)}) {measure}")
        axes.set_xlabel("close footholds (% of obstacle–foot pairs)")
        axes.margins(x=0.06)
    _limit(grid, panels, targets)
    grid[0].set_ylabel("library over LMTR, at equal avoidance (×)")
    entries = {
        label: handle
        for axes in grid
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(list(entries.values()), list(entries), loc="outside lower center", ncols=3)
    return figure


def _draw(axes: Axes, curve: Curve, name: str, style: SeriesStyle) -> None:
    curve = sorted(curve, key=lambda at: at.close_share)
    x = np.array([100.0 * at.close_share for at in curve])
    value, low, high = (
        np.array([getattr(at.ratio, end) for at in curve]) for end in ("value", "low", "high")
    )
    # Neither nothing nor infinity has a place on a logarithmic axis: arrows at its ends stand for
    # them.
    across = axes.get_xaxis_transform()
    for there, end, marker in ((value == 0.0, 0.02, "v"), (np.isposinf(value), 0.98, "^")):
        axes.plot(
            x[there],
            np.full(there.sum(), end),
            marker,
            color=style.colour,
            markersize=7.0,
            transform=across,
            zorder=3.1,
        )
    value = np.where((value > 0.0) & np.isfinite(value), value, np.nan)
    axes.plot(
        x,
        value,
        **style.drawn,
        markersize=4.5,
        markeredgewidth=0.0,
        linewidth=2.0,
        label=name,
        zorder=3.0,
    )
    bound = np.array([at.ratio.at_least for at in curve]) & np.isfinite(value)
    if bound.any():
        axes.plot(x[bound], value[bound], "^", color=style.colour, markersize=9.0, zorder=3.1)
    known = np.isfinite(low)
    if known.any():
        # An interval without an upper end leaves the axes.
        top = np.where(np.isfinite(high), high, BEYOND)
        axes.fill_between(x[known], low[known], top[known], color=style.colour, alpha=0.16, lw=0)
        # A band has no width where a level stands alone.
        axes.vlines(x[known], low[known], top[known], color=style.colour, alpha=0.45, lw=1.0)


def _limit(
    grid: Sequence[Axes],
    panels: Mapping[str, Mapping[str, Curve]],
    targets: Sequence[float],
) -> None:
    """Logarithmic limits around ratios and targets; intervals may leave them."""
    curves = [curve for each in panels.values() for curve in each.values()]
    ratios = np.array([at.ratio.value for curve in curves for at in curve])
    ratios = ratios[np.isfinite(ratios) & (ratios > 0.0)]
    low = min([1.0, *targets, *ratios.tolist()]) / 1.6
    high = max([*targets, *ratios.tolist()]) * 2.0
    for axes in grid:
        axes.set_ylim(low, high)
        log_axis(axes, "y")
        axes.set_ylim(low, high)
