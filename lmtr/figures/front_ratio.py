"""How many times milder one replanner violates than another, along the whole trade-off."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.figures.style import FULL_WIDTH, SeriesStyle, Styles, styled, styles_for
from lmtr.figures.sweep import log_axis


@dataclass(frozen=True)
class RatioCurve:
    """A ratio of two fronts at equal obstacle avoidance.

    Attributes:
        close_share: Share of close steps, ascending, (k,), 0 to 1.
        ratio: Violation of the first replanner over that of the second there, (k,).
        low: Lower end of the 95 % interval, (k,); NaN where it is not known.
        high: Upper end, (k,); infinite where the denominator may be nothing.
    """

    close_share: Array
    ratio: Array
    low: Array
    high: Array


@styled
def front_ratio_figure(
    panels: Mapping[str, Mapping[str, RatioCurve]],
    targets: Sequence[float] = (5.0, 10.0),
    styles: Styles | None = None,
) -> Figure:
    """One panel per measure of violation, one curve per pair of replanners.

    Args:
        panels: By measure, such as ``mean violation``, the curves by name of the pair.
        targets: Ratios to reach, drawn as dashed lines.
        styles: Styles of the pairs, if other figures show them too.

    Raises:
        DataError: There is no curve with a finite ratio.
    """
    finite = [
        np.isfinite(curve.ratio).any() for curves in panels.values() for curve in curves.values()
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
        axes.set_xlim(left=0.0)
    _limit(grid, panels, targets)
    grid[0].set_ylabel("library over LMTR, at equal avoidance (×)")
    entries = {
        label: handle
        for axes in grid
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(list(entries.values()), list(entries), loc="outside lower center", ncols=3)
    return figure


def _draw(axes: Axes, curve: RatioCurve, name: str, style: SeriesStyle) -> None:
    x = 100.0 * curve.close_share
    axes.plot(
        x,
        curve.ratio,
        color=style.colour,
        linestyle=style.line,
        marker=style.marker if np.isfinite(curve.ratio).sum() == 1 else "",
        linewidth=2.0,
        label=name,
        zorder=3.0,
    )
    known = np.isfinite(curve.low)
    if known.any():
        top = np.where(np.isfinite(curve.high), curve.high, 1e6)
        axes.fill_between(
            x[known], curve.low[known], top[known], color=style.colour, alpha=0.16, lw=0
        )


def _limit(
    grid: Sequence[Axes],
    panels: Mapping[str, Mapping[str, RatioCurve]],
    targets: Sequence[float],
) -> None:
    """Logarithmic limits around ratios and targets; intervals may leave them."""
    curves = [curve for each in panels.values() for curve in each.values()]
    ratios = np.concatenate([curve.ratio for curve in curves])
    ratios = ratios[np.isfinite(ratios) & (ratios > 0.0)]
    low = min([1.0, *targets, *ratios.tolist()]) / 1.6
    high = max([*targets, *ratios.tolist()]) * 2.0
    for axes in grid:
        axes.set_ylim(low, high)
        log_axis(axes, "y")
        axes.set_ylim(low, high)
