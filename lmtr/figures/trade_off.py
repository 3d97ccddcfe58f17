"""Trade-off of obstacle avoidance against kinematic violation (Fig. 4 c, Sec. 5.2)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from lmtr.errors import DataError
from lmtr.figures.labels import PointLabel, label_points
from lmtr.figures.style import FULL_WIDTH, INK, SeriesStyle, Styles, styled, styles_for
from lmtr.figures.sweep import log_axis
from lmtr.rollout.fronts import pareto_front

WIDTH = 0.72 * FULL_WIDTH
HEIGHT = 5.0

WIDE = 8.0
"""A violation whose largest value is so many times its smallest is drawn on a logarithmic axis."""

Interval = tuple[float, float]


@dataclass(frozen=True)
class TradeOff:
    """Aggregate performance of one replanner with one weight vector w of the task distance.

    Attributes:
        close_share: Share of obstacle–foot pairs with a close foothold, 0 to 1.
        violation: Violation measure, in the unit that the figure's label states.
        note: Written beside the point, such as w; may be empty.
        close_interval: 95 % interval of the share, where it is known.
        violation_interval: Likewise of the violation.
        reported: Whether this is the w that tables report, drawn as a star.
    """

    close_share: float
    violation: float
    note: str = ""
    close_interval: Interval | None = None
    violation_interval: Interval | None = None
    reported: bool = False


@styled
def trade_off_figure(
    points: Mapping[str, Sequence[TradeOff]],
    violation_label: str = "mean violation of the range of motion (mm)",
    styles: Styles | None = None,
) -> Figure:
    """One point per replanner and weight vector; the best corner is at the lower left.

    The points of a replanner that no other of its points beats in both measures are its front:
    they are joined, and have their intervals. The others are faint.

    Args:
        points: By replanner, its points.
        violation_label: What ``violation`` measures, with its unit.
        styles: Styles of the replanners, if other figures show them too.

    Raises:
        DataError: There is no point.
    """
    every = [point for series in points.values() for point in series]
    if not every:
        raise DataError("trade-off figure: needs at least one point, got none; evaluate replanners")
    styles = styles_for(points, styles)
    figure = Figure(figsize=(WIDTH, HEIGHT))
    figure.subplots_adjust(0.095, 0.11, 0.985, 0.93)
    axes = figure.subplots()
    ends = {
        name: _draw_series(axes, name, series, styles[name])
        for name, series in points.items()
        if series
    }
    _scale(axes, every)
    axes.set_xlabel("close footholds (% of obstacle–foot pairs)")
    axes.set_ylabel(violation_label)
    axes.set_title("Avoidance against kinematics: better towards the lower left")
    if any(point.reported for point in every):
        (star,) = axes.plot([], [], "*", color=INK, markersize=11)
        axes.legend([star], ["w that is reported"], loc="lower right", bbox_to_anchor=(1.0, 1.0))
    named = {name: end for name, end in ends.items() if np.isfinite(end).all()}
    label_points(axes, [PointLabel(name, *end, styles[name].colour) for name, end in named.items()])
    return figure


def _draw_series(
    axes: Axes, name: str, series: Sequence[TradeOff], style: SeriesStyle
) -> tuple[float, float]:
    """Draw a replanner's points; returns where its front ends."""
    ordered = sorted(series, key=lambda point: (point.close_share, point.violation))
    rates = np.array([(100.0 * point.close_share, point.violation) for point in ordered])
    axes.plot(
        *rates.T,
        style.marker,
        color=style.colour,
        markersize=5.0,
        markeredgewidth=0.0,
        alpha=0.38,
        label=name,
    )
    front = pareto_front(rates)
    best = [ordered[k] for k in front]
    axes.plot(
        *rates[front].T,
        **style.drawn,
        markersize=6.5,
        markeredgecolor="white",
        markeredgewidth=0.8,
        linewidth=1.5,
        zorder=3.0,
        label="_front",
    )
    for point in best:
        _draw_intervals(axes, point, style)
    for point in ordered:
        x = 100.0 * point.close_share
        if point.reported:
            axes.plot(
                [x],
                [point.violation],
                "*",
                color=style.colour,
                markersize=15,
                markeredgecolor=INK,
                markeredgewidth=0.8,
                zorder=4.0,
                label="_reported",
            )
        axes.annotate(
            point.note,
            (x, point.violation),
            xytext=(0, 7),
            textcoords="offset points",
            ha="center",
            fontsize=8,
            color=style.colour,
        )
    x, y = rates[front[-1] if len(front) else -1].tolist()
    return x, y


def _draw_intervals(axes: Axes, point: TradeOff, style: SeriesStyle) -> None:
    x = 100.0 * point.close_share
    lines = []
    if point.close_interval is not None:
        low, high = (100.0 * end for end in point.close_interval)
        lines.append(([low, high], [point.violation] * 2))
    if point.violation_interval is not None:
        lines.append(([x, x], list(point.violation_interval)))
    for across, up in lines:
        axes.plot(across, up, color=style.colour, linewidth=0.9, alpha=0.45, zorder=1.5)


def _scale(axes: Axes, points: Sequence[TradeOff]) -> None:
    """Limits, and a logarithmic vertical axis where violations differ by much.

    Below the least violation that is not zero it is linear, so that zero has a place too.
    """
    violations = np.array([point.violation for point in points])
    some = violations[np.isfinite(violations) & (violations > 0.0)]
    axes.margins(0.06)
    axes.set_ylim(bottom=0.0)
    if len(some) and some.max() > WIDE * some.min():
        axes.set_ylim(0.6 * some.min(), 1.5 * some.max())
        log_axis(axes, "y")
        if (violations == 0.0).any():
            ticks = axes.get_yticks()
            axes.set_yscale("symlog", linthresh=float(some.min()), linscale=0.4)
            axes.yaxis.set_minor_locator(NullLocator())
            shown = [0.0, *(tick for tick in ticks if tick >= some.min())]
            axes.set_yticks(shown, [f"{tick:g}" for tick in shown])
            axes.set_ylim(-0.08 * some.min(), 1.5 * some.max())
    axes.set_xlim(left=0.0)
