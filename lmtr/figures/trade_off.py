"""Trade-off of obstacle avoidance against kinematic violation (Fig. 4 c, Sec. 5.2)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from lmtr.errors import DataError
from lmtr.figures.style import HALF_WIDTH, Styles, styled, styles_for


@dataclass(frozen=True)
class TradeOff:
    """Aggregate performance of one replanner with one weight vector w of the task distance.

    Attributes:
        close_share: Share of obstacle–foot pairs with a close foothold, 0 to 1.
        violation: Violation measure, in the unit that the figure's label states.
        note: Written beside the point, such as w; may be empty.
    """

    close_share: float
    violation: float
    note: str = ""


@styled
def trade_off_figure(
    points: Mapping[str, Sequence[TradeOff]],
    violation_label: str = "mean violation of the range of motion (mm)",
    styles: Styles | None = None,
) -> Figure:
    """One point per replanner and weight vector; the best corner is at the lower left.

    Args:
        points: By replanner, its points; they are joined from few to many close footholds.
        violation_label: What ``violation`` measures, with its unit.
        styles: Styles of the replanners, if other figures show them too.

    Raises:
        DataError: There is no point.
    """
    if not any(points.values()):
        raise DataError("trade-off figure: needs at least one point, got none; evaluate replanners")
    styles = styles_for(points, styles)
    figure = Figure(figsize=(HALF_WIDTH * 1.25, 4.2), layout="constrained")
    axes = figure.subplots()
    for name, series in points.items():
        ordered = sorted(series, key=lambda point: point.close_share)
        x = [100.0 * point.close_share for point in ordered]
        y = [point.violation for point in ordered]
        style = styles[name]
        axes.plot(x, y, color=style.colour, linewidth=0.9, alpha=0.6)
        axes.plot(x, y, style.marker, color=style.colour, markersize=7, label=name)
        for point in ordered:
            axes.annotate(
                point.note,
                (100.0 * point.close_share, point.violation),
                xytext=(0, 7),
                textcoords="offset points",
                ha="center",
                fontsize=8,
                color=style.colour,
            )
    axes.margins(0.12)
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    axes.annotate(
        "better",
        xy=(0.015, 0.02),
        xytext=(0.13, 0.12),
        xycoords="axes fraction",
        arrowprops={"arrowstyle": "->", "color": "#888888"},
        color="#666666",
        fontsize=9,
    )
    axes.set_xlabel("close footholds (% of obstacle–foot pairs)")
    axes.set_ylabel(violation_label)
    axes.set_title("Avoidance against kinematics")
    axes.legend()
    return figure
