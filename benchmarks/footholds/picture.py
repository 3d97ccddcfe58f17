"""Two pictures: footholds beside lines, and what the forward range of motion costs."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.footholds.families import (
    BOXES,
    DISTANCES,
    FAMILIES,
    NONE,
    USED,
    called,
    in_box,
    of_family,
)
from benchmarks.footholds.solves import LIMIT, Walk
from benchmarks.footholds.summary import CLOSE, Summary, closest, of_group
from lmtr.figures.distributions import draw_distances
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

_REACH_BIN = 0.5
"""Width of a bin of reaches (cm)."""


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
        axes.axvline(100.0 * CLOSE[1], color=INK, linestyle=":", linewidth=1.0)
        axes.set_xlim(0.0, _FURTHEST)
        axes.set_xlabel("closest foothold of a foot to a line (cm)")
        axes.set_title(family.capitalize())
    _draw_by_foot(panels[1, 0], summary)
    _draw_by_line(panels[1, 1], summary)
    _draw_outcome(panels[1, 2], summary)
    return figure


def _of_used(summary: Summary) -> Summary:
    return {family: summary["families"][family][called(USED)] for family in FAMILIES}


def _draw_by_foot(axes: Axes, summary: Summary) -> None:
    found = _of_used(summary)
    place, width = np.arange(len(found)), 0.8 / len(FOOT_COLOURS)
    for number, (foot, colour) in enumerate(FOOT_COLOURS.items()):
        shares = [100.0 * mine["close_by_foot"][foot] for mine in found.values()]
        axes.bar(place + (number - 1.5) * width, shares, width, color=colour, label=foot)
    axes.set_xticks(place, _broken(found), fontsize=7.5)
    axes.set_ylabel(f"closer than {100 * CLOSE[1]:g} cm (% of pairs)")
    axes.set_title("By foot, with the potential")
    axes.legend(ncols=4, fontsize=8.0)


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
    axes.set_ylim(bottom=0.0)
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
    axes.invert_yaxis()
    axes.set_xlabel("tasks (%)")
    axes.set_title("The quality filter")
    axes.legend(fontsize=8.0, loc="lower left", frameon=True, framealpha=0.9)


def _broken(names: Sequence[str] | Summary) -> list[str]:
    return [name.replace(", ", ",\n") for name in names]


@styled
def box_picture(walks: Sequence[Walk], summary: Summary) -> Figure:
    """What a forward range of motion costs, and what it leaves to ±0.2 m."""
    figure = Figure(figsize=(FULL_WIDTH, 6.4), layout="constrained")
    panels = figure.subplots(2, 2)
    boxes = {box: summary["boxes"][f"{box:g}"] for box in BOXES}
    _draw_reach(panels[0, 0], walks)
    for axes, key, scale, label in (
        (panels[0, 1], "accepted", 100.0, "accepted, costs not judged (%)"),
        (panels[1, 0], "cost", 1.0, "median cost"),
        (panels[1, 1], "cpu_s", 1.0, "median CPU per solve (s)"),
    ):
        styles = series_styles([_name(box) for box in BOXES])
        for box, found in boxes.items():
            bins, style = found["by_distance"], styles[_name(box)]
            axes.plot(
                [0.5 * (each["from"] + each["to"]) for each in bins],
                [scale * each[key] for each in bins],
                color=style.colour,
                marker=style.marker,
                linestyle=style.line,
                label=_name(box),
            )
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel("goal distance (m)")
        axes.set_ylabel(label)
    panels[0, 1].set_ylim(0.0, 102.0)
    panels[0, 1].legend(loc="lower left")
    return figure


def _name(box: float) -> str:
    return f"±{box:.2f} m"


def _draw_reach(axes: Axes, walks: Sequence[Walk]) -> None:
    """Density of the furthest reach of each solution, near and far goals together."""
    styles = series_styles([_name(box) for box in BOXES])
    edges = _REACH_BIN * np.arange(np.ceil(100.0 * 1.3 * max(BOXES) / _REACH_BIN) + 1.0)
    for box in BOXES:
        mine = [walk for kind in DISTANCES for walk in of_group(walks, in_box(box, kind))]
        reach = np.array([100.0 * walk.reach for walk in mine if walk.converged])
        density, _ = np.histogram(reach, edges)
        style = styles[_name(box)]
        share = 100.0 * np.mean(reach > 100.0 * LIMIT)
        axes.stairs(
            density / len(reach),
            edges,
            color=style.colour,
            linestyle=style.line,
            linewidth=1.8,
            label=f"{_name(box)}: {share:.0f} % beyond",
        )
    axes.axvline(100.0 * LIMIT, color=INK, linestyle="--", linewidth=1.2)
    axes.set_xlim(100.0 * min(BOXES) - 3.0, 100.0 * LIMIT + 3.0)
    axes.set_xlabel("furthest that a standing foot is from neutral, forward (cm)")
    axes.set_ylabel("share of solutions")
    axes.legend(loc="upper left", fontsize=8.5, frameon=True, framealpha=0.85, edgecolor="none")
