"""What a data set of expert solutions is made of: outcomes, costs, effort, violations, margins."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.figures.style import ACCEPTED, FULL_WIDTH, GUESS, HALF_WIDTH, INK, REJECTED, styled

_BINS = 40
_COLUMNS = 3


@dataclass(frozen=True)
class Violation:
    """Largest violation of one rule in each solution.

    Attributes:
        values: (n,), in ``unit``.
        unit: Unit of values and limit.
        limit: Above it a solution is rejected; ``None`` if none is.
    """

    values: Array
    unit: str
    limit: float | None = None


@styled
def outcome_figure(accepted: int, rejected: Mapping[str, int]) -> Figure:
    """How many solutions were accepted, and how many rejected for each reason.

    Args:
        accepted: Number of accepted solutions.
        rejected: Number of solutions by reason; a solution may count under several.

    Raises:
        DataError: There is no solution at all.
    """
    ordered = sorted(rejected.items(), key=lambda item: -item[1])
    names = ["accepted", *(name for name, _ in ordered)]
    counts = [accepted, *(count for _, count in ordered)]
    if sum(counts) == 0:
        raise DataError("outcome figure: needs at least one solution, got 0; generate some first")
    figure = Figure(figsize=(HALF_WIDTH, 1.1 + 0.34 * len(names)), layout="constrained")
    axes = figure.subplots()
    bars = axes.barh(names, counts, color=[ACCEPTED] + [REJECTED] * len(ordered), height=0.7)
    axes.bar_label(bars, [f"{count:,}" for count in counts], padding=3)
    axes.set_xlim(0, 1.15 * max(counts))
    axes.invert_yaxis()
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("solutions (count; one may have several reasons)")
    axes.set_title("Outcome of the expert")
    return figure


@styled
def cost_figure(accepted: ArrayLike, rejected: ArrayLike, limit: float | None = None) -> Figure:
    """Distribution of the expert's cost over accepted and rejected solutions.

    Args:
        accepted: Costs of accepted solutions, (n,), no unit.
        rejected: Costs of rejected ones, (m,).
        limit: Cost above which solutions are rejected, if there is one for all.
    """
    good, bad = _finite("costs", accepted), _finite("costs", rejected)
    figure, axes = _half_figure("Cost of solutions")
    edges = _edges(np.concatenate([good, bad]), "cost figure")
    axes.hist(
        [good, bad],
        bins=edges,
        stacked=True,
        color=[ACCEPTED, REJECTED],
        label=[f"accepted ({len(good):,})", f"rejected ({len(bad):,})"],
    )
    if limit is not None:
        axes.axvline(limit, color=INK, linestyle="--", label=f"limit {limit:g}")
    axes.set_xlabel("cost of a solution (–)")
    axes.set_ylabel("solutions (count)")
    axes.legend()
    return figure


@styled
def effort_figure(solve_time: ArrayLike, iterations: ArrayLike) -> Figure:
    """Distributions of processor time (s) and of iterations of the optimizer."""
    times, counts = _finite("solve times", solve_time), _finite("iterations", iterations)
    figure = Figure(figsize=(FULL_WIDTH, 3.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    _draw_effort(left, times, _edges(times, "effort figure"), " s")
    left.set_xlabel("processor time of a solve (s)")
    left.set_title("Solve time")
    # Bins of whole iterations, lest some bins hold more integers than others.
    low, *_, high = _edges(counts, "effort figure")
    step = max(1, round((high - low) / _BINS))
    whole = np.arange(np.floor(low) - 0.5, np.ceil(high) + step, step)
    _draw_effort(right, counts, whole.tolist(), "")
    right.set_xlabel("iterations of the optimizer (count)")
    right.set_title("Iterations")
    return figure


def _draw_effort(axes: Axes, values: Array, edges: list[float], unit: str) -> None:
    axes.hist(values, bins=edges, color="#4FA8D8")
    for quantile, name, line in ((0.5, "median", "-"), (0.95, "95th percentile", "--")):
        value = float(np.quantile(values, quantile))
        axes.axvline(value, color=INK, linestyle=line, label=f"{name} {value:.3g}{unit}")
    axes.set_xlim(left=0.0)
    axes.set_ylabel("solutions (count)")
    axes.legend()


@styled
def violation_figure(violations: Mapping[str, Violation]) -> Figure:
    """Largest violation per solution of each rule, as sorted curves against its limit.

    The curve of a rule gives the share of solutions (vertical) that stay below a violation.

    Raises:
        DataError: No rule is given, or one has no finite value.
    """
    if not violations:
        raise DataError("violation figure: needs at least one rule, got none; measure some first")
    rows = -(-len(violations) // _COLUMNS)
    columns = -(-len(violations) // rows)
    figure = Figure(figsize=(FULL_WIDTH, 2.5 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False, sharey=True).ravel()
    for axes in panels[len(violations) :]:
        axes.set_axis_off()
    for axes, (name, violation) in zip(panels, violations.items(), strict=False):
        values = np.sort(_finite(name, violation.values))
        if not len(values):
            raise DataError(f"violation figure: {name!r} has no finite value; leave it out")
        axes.step(values, 100.0 * np.arange(1, len(values) + 1) / len(values), color="#332288")
        right = float(values[-1])
        if violation.limit is not None:
            beyond = float(np.mean(values > violation.limit))
            axes.axvline(violation.limit, color=REJECTED, linestyle="--")
            axes.set_title(
                f"limit {violation.limit:g} {violation.unit}: {100 * beyond:.1f} % beyond",
                fontsize=9.5,
                fontweight="normal",
                color="#A3415A",
            )
            # A few outliers must not squeeze the distribution against the axis.
            right = max(1.3 * violation.limit, min(right, 4.0 * violation.limit))
        axes.set_xlim(0.0, 1.05 * right if right > 0.0 else 1.0)
        axes.set_ylim(0.0, 102.0)
        axes.set_xlabel(f"{name} ({violation.unit})")
    for axes in panels[::columns]:
        axes.set_ylabel("solutions below (%)")
    return figure


@styled
def margin_figure(guess: ArrayLike, solution: ArrayLike) -> Figure:
    """Distances of the closest foothold to each obstacle line, before and after optimisation.

    Args:
        guess: Distances in initial guesses (m), one per obstacle and solution.
        solution: The same in the solutions.
    """
    figure, axes = _half_figure("Closest foothold to each obstacle line")
    before, after = (100.0 * _finite("distances", values) for values in (guess, solution))
    edges = _edges(np.concatenate([before, after]), "margin figure")
    for values, colour, name in ((before, GUESS, "initial guess"), (after, ACCEPTED, "solution")):
        if len(values):
            axes.hist(
                values,
                bins=edges,
                weights=np.full(len(values), 100.0 / len(values)),
                color=colour,
                alpha=0.6,
                label=f"{name} (median {np.median(values):.1f} cm)",
            )
    axes.set_xlim(left=0.0)
    axes.set_xlabel("distance of the closest foothold to the line (cm)")
    axes.set_ylabel("obstacle lines (% per bin)")
    axes.legend()
    return figure


def _half_figure(title: str) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(HALF_WIDTH, 3.2), layout="constrained")
    axes = figure.subplots()
    axes.set_title(title)
    return figure, axes


def _finite(name: str, values: ArrayLike) -> Array:
    array = np.asarray(values, dtype=float)
    if array.ndim != 1:
        raise DataError(f"data set figure: {name} must be one-dimensional, got {array.shape}")
    return np.asarray(array[np.isfinite(array)])


def _edges(values: Array, figure: str) -> list[float]:
    """Edges of equal bins over all values.

    Raises:
        DataError: There are no values.
    """
    if not len(values):
        raise DataError(f"{figure}: needs at least one finite value, got none")
    edges: list[float] = np.histogram_bin_edges(values, min(_BINS, 5 + len(values) // 4)).tolist()
    return edges
