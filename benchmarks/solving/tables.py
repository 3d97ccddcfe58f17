"""The benchmark's results for people."""

from collections.abc import Mapping, Sequence

import numpy as np
from rich.table import Table

from benchmarks.solving.figures import FIGURES, Better, Bound, Figure, Summary
from benchmarks.solving.pairs import LEVEL, PairedRatio
from benchmarks.solving.record import Result, has_worsened, ratio

ANOTHER_MACHINE = "≠"
NOTHING = "–"


def figures_table(title: str, now: Result, other: Summary | None, recorded: Result | None) -> Table:
    """Every figure beside its goals, another expert's and TOWR's, and the ratio to the record."""
    table = Table(title=title, title_justify="left")
    table.add_column("figure")  # the only column to give way on a narrow screen
    for name in ("this", *(["other"] if other else []), "target", "stretch"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("reached", no_wrap=True)
    table.add_column("of record", justify="right", no_wrap=True)
    table.add_column("TOWR", justify="right", no_wrap=True)
    for figure in FIGURES:
        value = now.summary[figure.key]
        table.add_row(
            f"{figure.label} ({figure.unit.symbol})".removesuffix(" ()"),
            f"[bold]{_value(figure, value)}[/]",
            *([_value(figure, other[figure.key])] if other else []),
            _bound(figure, figure.goal.target),
            _bound(figure, figure.goal.stretch),
            _mark(figure, value),
            _ratio(figure, now, recorded),
            figure.goal.peer,
        )
    return table


def reasons_table(counts: Mapping[str, tuple[int, int]], solves: int) -> Table:
    """Why solves were refused."""
    table = Table("refused for", title="Refused by the quality filter", title_justify="left")
    for name in ("solves", "%", "for this alone"):
        table.add_column(name, justify="right")
    for reason, (refused, alone) in counts.items():
        table.add_row(reason, str(refused), f"{100.0 * refused / solves:.1f}", str(alone))
    return table


def pairs_table(ratios: Mapping[str, PairedRatio]) -> Table:
    """This expert over the other one, task by task."""
    table = Table("this / other", title="Paired ratios over tasks", title_justify="left")
    for name in ("median", f"{100.0 * LEVEL:.0f} % interval", "tasks"):
        table.add_column(name, justify="right")
    for name, found in ratios.items():
        interval = f"{found.low:.3f} – {found.high:.3f}"
        table.add_row(name, f"[bold]{found.median:.3f}[/]", interval, str(found.pairs))
    return table


def outcomes(statuses: Sequence[str]) -> str:
    """How often each status came, most first."""
    names, counts = np.unique(statuses, return_counts=True)
    ordered = sorted(zip(counts.tolist(), names.tolist(), strict=True), reverse=True)
    return ", ".join(f"{count} {name.replace('_', ' ')}" for count, name in ordered)


def _value(figure: Figure, value: float) -> str:
    return NOTHING if np.isnan(value) else f"{value * figure.unit.per_si:.3g}"


def _bound(figure: Figure, bound: Bound | None) -> str:
    if bound is None:
        return ""
    shown = [f"{end * figure.unit.per_si:g}" for end in np.atleast_1d(bound)]
    sign = "≥ " if figure.better == Better.HIGHER else "≤ "
    return "–".join(shown) if len(shown) > 1 else sign + shown[0]


def _mark(figure: Figure, value: float) -> str:
    if figure.reaches(value, figure.goal.stretch):
        return "[green]stretch[/]"
    marks = {True: "[green]yes[/]", False: "[red]no[/]", None: ""}
    return marks[figure.reaches(value, figure.goal.target)]


def _ratio(figure: Figure, now: Result, recorded: Result | None) -> str:
    if recorded is None:
        return ""
    quotient = ratio(now.summary, recorded.summary, figure)
    if np.isnan(quotient):
        return NOTHING
    if figure.timed and now.circumstances.processor != recorded.circumstances.processor:
        return f"[dim]{quotient:.2f} {ANOTHER_MACHINE}[/]"
    colour = {True: "red", False: "green", None: "default"}[has_worsened(figure, quotient)]
    return f"[{colour}]{quotient:.2f}[/]"
