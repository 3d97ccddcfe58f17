"""Measures over one parameter of a study: latent dimension, amount of data, κ.

Seeds are points, their mean a line, and what does not depend on the parameter a horizontal band.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator, StrMethodFormatter

from lmtr.errors import DataError
from lmtr.figures.style import FULL_WIDTH, SeriesStyle, Styles, styled, styles_for

COLUMNS = 3
"""Panels in one row, at most."""

BESIDE = 0.07
"""Seeds are drawn so far to the right of their mean, in units of the spacing of values."""

SPARSE = 2.3
"""A logarithmic axis that spans less than so many decades is given labels between its decades."""


@dataclass(frozen=True)
class SweepSeries:
    """One measure of one kind of model over the parameter.

    Attributes:
        name: Its name in the legend.
        seeds: By value of the parameter, the measure of each training seed, not empty.
        intervals: By value of the parameter, the 95 % interval of the mean, where it is known.
    """

    name: str
    seeds: Mapping[float, Sequence[float]]
    intervals: Mapping[float, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Reference:
    """A measure of something that does not depend on the parameter.

    Attributes:
        name: Its name in the legend.
        value: The measure.
        interval: Its 95 % interval, where it is known.
    """

    name: str
    value: float
    interval: tuple[float, float] | None = None


@dataclass(frozen=True)
class SweepPanel:
    """One measure.

    Attributes:
        title: What it is.
        label: Label of the axis, with the unit.
        series: Curves; they may be empty of some values of the parameter.
        references: Horizontal lines.
        log: Whether the axis is logarithmic; zeros are then left out.
        target: A value to reach, drawn as a dashed line.
    """

    title: str
    label: str
    series: Sequence[SweepSeries]
    references: Sequence[Reference] = ()
    log: bool = False
    target: float | None = None

    @property
    def drawn(self) -> bool:
        """Whether there is anything finite to draw."""
        every = [y for series in self.series for seeds in series.seeds.values() for y in seeds]
        return bool(np.isfinite(every).any())


@styled
def sweep_figure(
    panels: Sequence[SweepPanel],
    parameter: str,
    styles: Styles | None = None,
    ticks: Mapping[float, str] | None = None,
) -> Figure:
    """Small multiples of measures over a parameter.

    Its values are evenly spaced in the order of their size, so that 0, 1, 2, … and 8, 12, 16 are
    told apart alike.

    Args:
        panels: The measures.
        parameter: Label of the horizontal axes, with the unit.
        styles: Styles of all series and references, if other figures show them too.
        ticks: How values of the parameter are written; by default as numbers.

    Raises:
        DataError: There is no panel, or one without a finite value.
    """
    if not panels:
        raise DataError("sweep figure: needs at least one panel, got none; evaluate models first")
    values = sorted({x for p in panels for s in p.series for x in s.seeds})
    if not values:
        raise DataError(
            f"sweep figure: needs a value of {parameter!r}, got none; evaluate models first"
        )
    names = dict.fromkeys(
        [s.name for p in panels for s in p.series] + [r.name for p in panels for r in p.references]
    )
    styles = styles_for(names, styles)
    rows = -(-len(panels) // COLUMNS)
    columns = -(-len(panels) // rows)
    figure = Figure(figsize=(FULL_WIDTH, 3.05 * rows + 0.45), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for number, (axes, panel) in enumerate(zip(grid, panels, strict=False)):
        _draw_panel(axes, panel, values, styles)
        axes.set_title(f"({chr(ord('a') + number)}) {panel.title}")
        axes.set_xlabel(parameter)
        written = [ticks[x] if ticks else f"{x:,g}" for x in values]
        axes.set_xticks(range(len(values)), written)
    for axes in grid[len(panels) :]:
        axes.set_axis_off()
    _key(figure)
    return figure


def _draw_panel(axes: Axes, panel: SweepPanel, values: list[float], styles: Styles) -> None:
    for reference in panel.references:
        _draw_reference(axes, reference, styles[reference.name])
    shift = np.linspace(-0.12, 0.12, len(panel.series)) if len(panel.series) > 1 else [0.0]
    for series, moved in zip(panel.series, shift, strict=True):
        _draw_series(axes, series, values, float(moved), styles[series.name])
    if panel.target is not None:
        axes.axhline(panel.target, color="#444444", linestyle=(0, (2, 2)), lw=1.0, label="target")
    drawn = [y for s in panel.series for seeds in s.seeds.values() for y in seeds]
    drawn += [reference.value for reference in panel.references]
    if not panel.drawn:
        raise DataError(f"sweep figure: panel {panel.title!r} has no finite value; leave it out")
    positive = [y for y in drawn if y > 0.0]
    if panel.log and positive:
        axes.set_ylim(bottom=0.5 * min(positive))
        log_axis(axes, "y")
    else:
        _, top = axes.get_ylim()
        axes.set_ylim(0.0, 1.04 * top)
    axes.set_xlim(-0.4, len(values) - 0.6)
    axes.grid(visible=False, axis="x")
    axes.set_ylabel(panel.label)


def _draw_reference(axes: Axes, reference: Reference, style: SeriesStyle) -> None:
    if reference.interval is not None:
        axes.axhspan(*reference.interval, color=style.colour, alpha=0.13, lw=0, zorder=0.4)
    axes.axhline(
        reference.value,
        color=style.colour,
        linestyle=style.line,
        linewidth=1.4,
        zorder=1.0,
        label=reference.name,
    )


def _draw_series(
    axes: Axes, series: SweepSeries, values: list[float], moved: float, style: SeriesStyle
) -> None:
    known = [x for x in values if x in series.seeds]
    places = np.array([values.index(x) for x in known]) + moved
    means = np.array([np.mean(series.seeds[x]) for x in known])
    axes.plot(
        places,
        means,
        **style.drawn,
        markersize=6.0,
        markeredgecolor="white",
        markeredgewidth=0.8,
        zorder=3.0,
        label=series.name,
    )
    for place, x, mean in zip(places.tolist(), known, means.tolist(), strict=True):
        if len(series.seeds[x]) > 1:
            seeds = np.asarray(series.seeds[x], dtype=float)
            axes.plot(
                np.full(len(seeds), place + BESIDE),
                seeds,
                "o",
                color=style.colour,
                alpha=0.7,
                markersize=3.0,
                markeredgewidth=0.0,
                zorder=2.0,
            )
        if x in series.intervals:
            below, above = series.intervals[x]
            axes.errorbar(
                place,
                mean,
                [[max(0.0, mean - below)], [max(0.0, above - mean)]],
                color=style.colour,
                elinewidth=1.1,
                capsize=2.5,
                zorder=2.5,
            )


def log_axis(axes: Axes, which: str) -> None:
    """Make an axis logarithmic, with plain numbers at enough of its ticks.

    Args:
        axes: Axes whose limits hold the data.
        which: ``x`` or ``y``.
    """
    axes.set(**{f"{which}scale": "log"})
    axes.autoscale_view()
    axis = axes.xaxis if which == "x" else axes.yaxis
    low, high = axis.get_view_interval()
    decades = np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    short = np.log10(high / low) < SPARSE
    ticks = np.outer(10.0**decades, [1.0, 2.0, 5.0] if short else [1.0]).ravel()
    ticks = ticks[(ticks >= low * 0.999) & (ticks <= high * 1.001)]
    if len(ticks) < 2:
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_formatter(StrMethodFormatter("{x:g}"))
        return
    axis.set_major_locator(FixedLocator(ticks.tolist()))
    axis.set_major_formatter(FixedFormatter([f"{tick:g}" for tick in ticks]))
    if short:
        axis.set_minor_locator(NullLocator())


def _key(figure: Figure) -> None:
    """One legend under all panels, each series named once."""
    entries = {
        label: handle
        for axes in figure.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    if len(entries) < 2:
        return
    figure.legend(
        list(entries.values()),
        list(entries),
        loc="outside lower center",
        ncols=min(5, len(entries)),
    )
