"""What the walks come to, as tables for a terminal."""

from collections.abc import Iterator
from typing import Any

from rich.table import Table

from benchmarks.footholds.families import NONE, USED, called
from benchmarks.footholds.summary import CLOSE, Summary
from lmtr.robot.model import FEET

NOTHING = "–"


def tables(summary: Summary) -> Iterator[Table]:
    """All tables, one question each."""
    yield _families(summary["families"])
    yield _pairs(summary["families"])
    yield _uncrossed(summary)
    yield _boxes(summary["boxes"])
    yield _distances(summary["boxes"])


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left")
    for number, column in enumerate(columns):
        table.add_column(column, justify="right" if number else "left")
    return table


def _percent(value: float | None) -> str:
    return NOTHING if value is None else f"{100.0 * value:.1f}"


def _cm(value: float) -> str:
    return f"{100.0 * value:.1f}"


def _families(families: Summary) -> Table:
    table = _table(
        "Tasks among lines, by potential (weight, σ)",
        *("family", "potential", "converged %", "accepted %", "CPU s", "iterations", "cost"),
        *("accepted but for cost %", "refused for"),
    )
    for family, by_potential in families.items():
        for potential, found in by_potential.items():
            # Who does not know of lines steps on them; that says nothing of the filter.
            blind = potential == called(NONE)
            table.add_row(
                family,
                potential,
                *_outcome(found, NOTHING if blind else _percent(found["accepted"])),
                NOTHING if blind else _percent(found["accepted_but_for_cost"]),
                NOTHING if blind else _reasons(found),
            )
    return table


def _outcome(found: dict[str, Any], accepted: str) -> tuple[str, ...]:
    return (
        _percent(found["converged"]),
        accepted,
        f"{found['cpu_s']:.2f}",
        f"{found['iterations']:.0f}",
        f"{found['cost']:.2f}",
    )


def _reasons(found: dict[str, Any]) -> str:
    return ", ".join(f"{name} {count}" for name, count in found["reasons"].items())


def _pairs(families: Summary) -> Table:
    near, filtered = (f"{close:g}" for close in CLOSE)
    table = _table(
        "Closest footholds (cm); shares of pairs of a line and a foot, and of footholds (%)",
        *("family", "potential", "median", "p5", "least", "pairs < 5", "pairs < 10"),
        *("footholds < 5", "footholds < 10", "pairs < 10 by line", f"by {' '.join(FEET)}"),
    )
    for family, by_potential in families.items():
        for potential, found in by_potential.items():
            closest = found["closest_foothold"]
            table.add_row(
                family,
                potential,
                *(_cm(closest[name]) for name in ("median", "p5", "least")),
                *(_percent(found["pairs_close"][key]) for key in (near, filtered)),
                *(_percent(found["footholds_close"][key]) for key in (near, filtered)),
                " ".join(_percent(share) for share in found["close_by_line"]),
                " ".join(_percent(share) for share in found["close_by_foot"].values()),
            )
    return table


def _uncrossed(summary: Summary) -> Table:
    table = _table(
        "Lines at the goal: shares of tasks (%), and of walks that leave a hind foot before a line",
        *("family", "left ahead", "straddled", "foot within 10 cm", "hind foot left", "accepted"),
    )
    for family, found in summary["uncrossed"].items():
        walks = summary["families"][family][called(USED)]
        names = ("hind_foot_left", "accepted_of_these")
        table.add_row(
            family,
            *(_percent(found[n]) for n in ("left_ahead", "straddled", "foot_on_line_at_goal")),
            *(_percent(walks[name]) for name in names),
        )
    return table


def _boxes(boxes: Summary) -> Table:
    table = _table(
        "Forward range of motion (m); reach beyond ±0.2 m on a 5 ms grid; costs are not judged",
        *("box", "goals", "converged %", "accepted %", "CPU s", "iterations", "cost"),
        *("cost ratio", "walks beyond %", "beyond, worst mm", "mean mm", "own box, worst mm"),
        "refused for",
    )
    for box, found in boxes.items():
        for distance, mine in found.items():
            if distance != "by_distance":
                table.add_row(
                    box,
                    distance,
                    *_outcome(mine, _percent(mine["accepted"])),
                    f"{mine['cost_ratio']:.3f}",
                    _percent(mine["share_beyond_limit"]),
                    f"{1000.0 * mine['beyond_limit']['largest']:.1f}",
                    f"{1000.0 * mine['mean_violation']:.4f}",
                    f"{1000.0 * mine['own_overshoot']['largest']:.1f}",
                    _reasons(mine),
                )
    return table


def _distances(boxes: Summary) -> Table:
    bins = sorted({(b["from"], b["to"]) for box in boxes.values() for b in box["by_distance"]})
    table = _table(
        "Converged / accepted (%) by goal distance (m)",
        "box",
        *(f"{low:g}–{high:g}" for low, high in bins),
    )
    for box, found in boxes.items():
        cells = {
            (b["from"], b["to"]): f"{100 * b['converged']:.0f} / {100 * b['accepted']:.0f}"
            for b in found["by_distance"]
        }
        table.add_row(box, *(cells.get(each, NOTHING) for each in bins))
    return table
