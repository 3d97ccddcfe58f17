"""Two pictures: footholds beside lines, and what the forward range of motion costs."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from benchmarks.footholds.families import (
    DISTANCES,
    FAMILIES,
    NONE,
    USED,
    called,
    of_family,
)
from benchmarks.footholds.solves import Walk
from benchmarks.footholds.summary import CLOSE, Summary, closest, of_group
from lmtr.figures.distributions import CLOSE_BAND, draw_distances
from lmtr.figures.style import (
    ACCEPTED,
    FOOT_COLOURS,
    FULL_WIDTH,
    INK,
    REJECTED,
    series_styles,
    styled,
)

_SHOWN = ("two lines", "four lines", "four, one at the start")
"""Families with a panel of their own."""

_FURTHEST = 50.0
"""Right end of the axes of distances (cm)."""

_FILTER_LINE: dict[str, Any] = {"color": INK, "linestyle": ":", "linewidth": 1.0}
"""Look of the filter's limit."""


@styled
def foothold_picture(walks: Sequence[Walk], summary: Summary) -> Figure:
    """Distances of footholds to lines with and without the potential, and where they are close."""
    figure = Figure(figsize=(FULL_WIDTH, 7.0), layout="constrained")
    panels = figure.subplots(2, 3)
    styles = series_styles(("with the potential", "without"))
    for axes, family in zip(panels[0], _SHOWN, strict=True):
        distances = {
            name: closest(of_group(walks, of_family(family, potential)))
            for name, potential in zip(styles, (USED, NONE), strict=True)
        }
        draw_distances(axes, distances, CLOSE[0], styles)
        axes.axvline(100.0 * CLOSE[1], **_FILTER_LINE)
        axes.set_xlim(0.0, _FURTHEST)
        axes.set_xlabel("closest foothold of a foot to a line (cm)")
        axes.set_title(family.capitalize())
    _draw_by_foot(panels[1, 0], summary)
    _draw_by_line(panels[1, 1], summary)
    _draw_outcome(panels[1, 2], summary)
    figure.legend(handles=_limits_key(), loc="outside upper center", ncols=2)
    return figure


def _limits_key() -> list[Patch | Line2D]:
    close, filtered = (f"{100.0 * limit:g} cm" for limit in CLOSE)
    return [
        Patch(color=CLOSE_BAND, label=f"up to {close}: a close step of a replanner"),
        Line2D([], [], label=f"{filtered}: the filter refuses what is nearer", **_FILTER_LINE),
    ]


def _of_used(summary: Summary) -> Summary:
    return {family: summary["families"][family][called(USED)] for family in FAMILIES}


def _draw_by_foot(axes: Axes, summary: Summary) -> None:
    found = _of_used(summary)
    place, width = np.arange(len(found)), 0.8 / len(FOOT_COLOURS)
    for number, (foot, colour) in enumerate(FOOT_COLOURS.items()):
        shares = [100.0 * mine["close_by_foot"][foot] for mine in found.values()]
        axes.bar(place + (number - 1.5) * width, shares, width, color=colour, label=foot)
    axes.set_xticks(place, _broken(found), fontsize=7.0)
    axes.set_ylabel(f"closer than {100 * CLOSE[1]:g} cm (% of pairs)")
    axes.set_title("By foot, with the potential")
    _with_room(axes)
    axes.legend(ncols=4, fontsize=8.0, handlelength=1.2)


def _draw_by_line(axes: Axes, summary: Summary) -> None:
    found = _of_used(summary)
    styles = series_styles(found)
    for family, mine in found.items():
        shares = 100.0 * np.array(mine["close_by_line"])
        axes.plot(
            np.arange(1, len(shares) + 1),
            shares,
            color=styles[family].colour,
            marker=styles[family].marker,
            linestyle=styles[family].line,
            label=family,
        )
    axes.set_xticks(range(1, 5))
    axes.set_xlabel("line, counted from the start")
    axes.set_ylabel(f"closer than {100 * CLOSE[1]:g} cm (% of pairs)")
    axes.set_title("By line, with the potential")
    _with_room(axes)
    axes.legend(fontsize=8.0)


def _draw_outcome(axes: Axes, summary: Summary) -> None:
    found = _of_used(summary)
    place = np.arange(len(found))
    accepted = np.array([100.0 * mine["accepted"] for mine in found.values()])
    beside = np.array(
        [100.0 * mine["reasons"].get("obstacle", 0) / mine["tasks"] for mine in found.values()]
    )
    axes.barh(place, accepted, color=ACCEPTED, label="accepted")
    axes.barh(place, beside, left=accepted, color=REJECTED, label="refused, too near a line")
    rest = 100.0 - accepted - beside
    axes.barh(place, rest, left=accepted + beside, color="#DDCCCC", label="refused, only otherwise")
    axes.set_yticks(place, _broken(found), fontsize=8.0)
    axes.set_ylim(len(found) + 0.9, -0.6)  # room for the legend below
    axes.set_xlabel("tasks (%)")
    axes.set_title("The quality filter")
    axes.legend(fontsize=8.0, loc="lower left")


def _broken(names: Iterable[str]) -> list[str]:
    return [name.replace(" lines", "\nlines").replace(", one at ", ",\none at\n") for name in names]


def _with_room(axes: Axes) -> None:
    """Room above what is drawn for the legend."""
    axes.set_ylim(0.0, 1.4 * max(axes.get_ylim()[1], 1.0))


@styled
def box_picture(summary: Summary) -> Figure:
    """What a forward range of motion costs, by goal distance, and what it leaves to ±0.2 m."""
    figure = Figure(figsize=(FULL_WIDTH, 6.4), layout="constrained")
    panels = figure.subplots(2, 2)
    for axes, key, scale, label in (
        (panels[0, 0], "converged", 100.0, "converged (%)"),
        (panels[0, 1], "accepted", 100.0, "accepted, costs not judged (%)"),
        (panels[1, 0], "cost", 1.0, "median cost"),
        (panels[1, 1], "cpu_s", 1.0, "median CPU per solve (s)"),
    ):
        _draw_by_distance(axes, summary["boxes"], key, scale)
        axes.set_ylabel(label)
    for axes in panels[0]:
        axes.set_ylim(0.0, 102.0)
    panels[0, 0].legend(loc="lower left", title="forward box: solutions beyond ±0.2 m")
    return figure


def _draw_by_distance(axes: Axes, boxes: Summary, key: str, scale: float) -> None:
    styles = series_styles(boxes)
    for box, found in boxes.items():
        bins, style = found["by_distance"], styles[box]
        beyond = [found[kind]["share_beyond_limit"] for kind in DISTANCES]
        axes.plot(
            [0.5 * (each["from"] + each["to"]) for each in bins],
            [scale * each[key] for each in bins],
            color=style.colour,
            marker=style.marker,
            linestyle=style.line,
            label=f"±{box} m: {100.0 * np.mean(beyond):.0f} %",
        )
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("goal distance (m)")
