"""Dot plots: several measures of several alternatives, each with its interval."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lmtr.errors import DataError
from lmtr.figures.style import FULL_WIDTH, Styles, styled, styles_for
from lmtr.figures.sweep import log_axis


@dataclass(frozen=True)
class Dot:
    """A measure of one alternative.

    Attributes:
        value: The measure.
        interval: Its 95 % interval, where it is known.
        seeds: The measure of each training seed, where there are several.
    """

    value: float
    interval: tuple[float, float] | None = None
    seeds: tuple[float, ...] = ()


@dataclass(frozen=True)
class DotPanel:
    """One measure of all alternatives.

    Attributes:
        label: Label of the axis, with the unit.
        dots: By alternative and series; what is missing is left out.
        log: Whether the axis is logarithmic, where all values are positive.
        reference: A value to hold all others against, drawn as a line.
    """

    label: str
    dots: Mapping[tuple[str, str], Dot]
    log: bool = False
    reference: float | None = None


@styled
def dot_figure(
    panels: Sequence[DotPanel],
    alternatives: Sequence[str],
    styles: Styles | None = None,
    title: str = "",
) -> Figure:
    """Alternatives one below the other, one column per measure, one mark per series.

    Args:
        panels: The measures.
        alternatives: Their rows, from top to bottom.
        styles: Styles of the series, if other figures show them too.
        title: Headline.

    Raises:
        DataError: There is no panel or alternative, or a panel without a dot in one of them.
    """
    if not panels or not alternatives:
        raise DataError("dot figure: needs panels and alternatives, got none; evaluate some first")
    for panel in panels:
        if not any(row in alternatives for row, _ in panel.dots):
            raise DataError(f"dot figure: panel {panel.label!r} has no dot; leave it out")
    series = list(dict.fromkeys(name for panel in panels for _, name in panel.dots))
    styles = styles_for(series, styles)
    lane = 0.30 if len(series) > 1 else 0.34
    height = max(1.2, lane * len(alternatives) * max(1.0, 0.62 * len(series))) + 1.15
    figure = Figure(figsize=(FULL_WIDTH, height), layout="constrained")
    grid = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axes, panel in zip(grid, panels, strict=True):
        _draw_panel(axes, panel, alternatives, series, styles)
        axes.tick_params(axis="y", length=0)
    grid[0].set_yticks(range(len(alternatives)), alternatives)
    grid[0].set_ylim(len(alternatives) - 0.5, -0.5)
    if title:
        figure.suptitle(title, x=0.01, ha="left")
    handles, labels = [], []
    for axes in grid:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            if label not in labels:
                handles.append(handle)
                labels.append(label)
    if len(labels) > 1:
        figure.legend(handles, labels, loc="outside lower center", ncols=min(5, len(labels)))
    return figure


def _draw_panel(
    axes: Axes,
    panel: DotPanel,
    alternatives: Sequence[str],
    series: Sequence[str],
    styles: Styles,
) -> None:
    lanes = np.linspace(-0.26, 0.26, len(series)) if len(series) > 1 else np.zeros(1)
    for row in range(0, len(alternatives), 2):
        axes.axhspan(row - 0.5, row + 0.5, color="#F4F4F4", lw=0, zorder=0.1)
    if panel.reference is not None:
        axes.axvline(panel.reference, color="#555555", lw=1.0, linestyle=(0, (2, 2)), zorder=0.5)
    for name, lane in zip(series, lanes.tolist(), strict=True):
        style, named = styles[name], False
        for row, alternative in enumerate(alternatives):
            dot = panel.dots.get((alternative, name))
            if dot is None or not np.isfinite(dot.value):
                continue
            place = row + lane
            if dot.interval is not None:
                axes.plot(dot.interval, [place, place], color=style.colour, lw=1.6, alpha=0.75)
            if len(dot.seeds) > 1:
                axes.plot(
                    dot.seeds,
                    [place] * len(dot.seeds),
                    "|",
                    color=style.colour,
                    markersize=6.5,
                    markeredgewidth=1.0,
                    alpha=0.8,
                )
            axes.plot(
                [dot.value],
                [place],
                style.marker,
                color=style.colour,
                markersize=6.5,
                markeredgecolor="white",
                markeredgewidth=0.7,
                zorder=3.0,
                label=None if named else name,
            )
            named = True
    values = [dot.value for dot in panel.dots.values() if np.isfinite(dot.value)]
    ends = [dot.interval[0] for dot in panel.dots.values() if dot.interval is not None]
    if panel.log and min([*values, *ends], default=0.0) > 0.0:
        log_axis(axes, "x")
    elif min(values, default=0.0) >= 0.0:
        axes.set_xlim(left=0.0)
    axes.grid(visible=False, axis="y")
    axes.set_xlabel(panel.label)
