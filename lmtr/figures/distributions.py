"""The two distributions by which replanners are judged (Fig. 4 a–b, Sec. 5.2)."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.figures.style import FULL_WIDTH, SeriesStyle, Styles, styled, styles_for
from lmtr.streams import Purpose, stream

DISTANCE_BIN = 2.0
"""Width of a bin of foothold distances (cm)."""

VIOLATION_BIN = 1.0
"""Width of a bin of range-of-motion violations (cm)."""

CLOSE_BAND = "#F1DDE0"
"""Colour behind distances that count as close, and violations that count as severe."""

QUIET = "#B9B9B9"
"""Colour of replanners that are drawn for comparison only."""

DRAWS = 400
"""Bootstrap draws of a band; its ends then repeat to a few per cent of its width."""

DECADES = 3.0
"""A logarithmic density reaches so many decades down from its largest value, at most."""

OTHERS = "others"
"""Name of the replanners that are not told apart."""

Rollouts = Sequence[ArrayLike]
"""Values of one replanner, one array per rollout; a single array has no band."""


@styled
def distribution_figure(
    distances: Mapping[str, Rollouts],
    violations: Mapping[str, Rollouts],
    close: float = 0.05,
    severe: float = 0.05,
    styles: Styles | None = None,
    highlighted: Collection[str] | None = None,
) -> Figure:
    """Both distributions side by side, one colour per replanner (Fig. 4 a–b).

    Bands are 95 % intervals by bootstrap over rollouts.

    Args:
        distances: By replanner and rollout, distances (m) of the closest foothold of each foot to
            each obstacle line.
        violations: By replanner and rollout, violations (m) of the forward range of motion by each
            contacting foot in each sample; zero where there is none.
        close: A foothold nearer than this (m) counts as close; its share is in the legend.
        severe: A violation beyond this (m) counts as severe.
        styles: Styles of the replanners, if other figures show them too.
        highlighted: Replanners to tell apart, the others being thin and grey; all by default.

    Raises:
        DataError: A replanner is missing in one of the two, or has no finite value.
    """
    if not distances or set(distances) != set(violations):
        raise DataError(
            "distribution figure: distances and violations must name the same replanners, got "
            f"{sorted(distances)} and {sorted(violations)}; evaluate all of them"
        )
    styles = styles_for(distances, styles)
    shown = [name for name in distances if highlighted is None or name in highlighted]
    rows = max(1, len(shown) + (len(shown) < len(distances)))
    figure = Figure(figsize=(FULL_WIDTH, 3.9 + 0.19 * rows), layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_distances(left, distances, close, styles, shown)
    draw_violations(right, violations, severe, styles, shown)
    for axes in (left, right):
        # Below the axes, so that it covers no curve however many there are.
        _key(axes)
    return figure


def draw_distances(
    axes: Axes,
    distances: Mapping[str, Rollouts],
    close: float,
    styles: Styles,
    shown: Collection[str] | None = None,
) -> None:
    """Fig. 4 a: probability density of the closest foothold's distance; each area is one."""
    samples = {name: _in_cm(name, values) for name, values in distances.items()}
    pooled = {name: np.concatenate(each) for name, each in samples.items()}
    edges = _edges(DISTANCE_BIN, max(float(values.max()) for values in pooled.values()))
    axes.axvspan(0.0, 100.0 * close, color=CLOSE_BAND, lw=0, zorder=0.2)
    for name, rollouts in samples.items():
        counts = np.array([np.histogram(values, edges)[0] for values in rollouts], dtype=float)
        totals = np.array([len(values) for values in rollouts], dtype=float) * DISTANCE_BIN
        share = 100.0 * float(np.mean(pooled[name] < 100.0 * close))
        label = f"{name}: {share:.1f} % under {100 * close:g} cm"
        _draw(axes, counts, totals, edges, label, styles[name], shown is None or name in shown)
    axes.set_xlim(0.0, DISTANCE_BIN * np.ceil(_quantile(pooled, 0.995) / DISTANCE_BIN))
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("distance of the closest foothold to an obstacle line (cm)")
    axes.set_ylabel("probability density (1/cm)")
    axes.set_title("(a) Obstacle avoidance")


def draw_violations(
    axes: Axes,
    violations: Mapping[str, Rollouts],
    severe: float,
    styles: Styles,
    shown: Collection[str] | None = None,
) -> None:
    """Fig. 4 b: density of violations, logarithmic, since most samples have none.

    The area under a curve is the share of samples with a violation.
    """
    samples = {name: _in_cm(name, values) for name, values in violations.items()}
    pooled = {name: np.concatenate(each) for name, each in samples.items()}
    top = max(VIOLATION_BIN, 100.0 * severe, *(float(v.max()) for v in pooled.values()))
    edges = _edges(VIOLATION_BIN, top)
    axes.axvline(100.0 * severe, color="#AAAAAA", linestyle=":", zorder=0.3)
    highest, least = 0.0, np.inf
    for name, rollouts in samples.items():
        counts = np.array(
            [np.histogram(values[values > 0.0], edges)[0] for values in rollouts], dtype=float
        )
        totals = np.array([len(values) for values in rollouts], dtype=float) * VIOLATION_BIN
        values, told = pooled[name], shown is None or name in shown
        share = 100.0 * float(np.mean(values > 100.0 * severe))
        label = f"{name}: mean {10 * values.mean():.2g} mm, {share:.2g} % over {100 * severe:g} cm"
        _draw(axes, counts, totals, edges, label, styles[name], told, log=True)
        highest = max(highest, float(counts.sum(axis=0).max() / totals.sum()))
        least = min(least, 1.0 / totals.sum())
    right = max(_quantile(pooled, 0.9995), 120.0 * severe)
    axes.set_xlim(0.0, VIOLATION_BIN * np.ceil(right / VIOLATION_BIN))
    if highest > 0.0:
        axes.set_yscale("log")
        axes.set_ylim(max(highest * 10.0**-DECADES, 0.7 * least), 2.0 * highest)
    axes.set_xlabel("violation of the forward range of motion (cm)")
    axes.set_ylabel("probability density (1/cm)")
    axes.set_title("(b) Kinematic violation")


def _draw(
    axes: Axes,
    counts: Array,
    totals: Array,
    edges: Array,
    label: str,
    style: SeriesStyle,
    shown: bool,
    log: bool = False,
) -> None:
    """One density: counts (R, bins) over totals (R,) of its rollouts, with its band."""
    centres = (edges[:-1] + edges[1:]) / 2.0
    density = counts.sum(axis=0) / totals.sum()
    if log:
        # A logarithmic axis has no place for bins without a count: the curve is interrupted there.
        density = np.where(density > 0.0, density, np.nan)
    if not shown:
        told = OTHERS in axes.get_legend_handles_labels()[1]
        axes.plot(
            centres, density, color=QUIET, lw=0.9, label="_other" if told else OTHERS, zorder=1.2
        )
        return
    if len(totals) > 1:
        low, high = _band(counts, totals)
        axes.fill_between(centres, low, high, color=style.colour, alpha=0.12, lw=0, zorder=1.4)
    axes.plot(
        centres,
        density,
        **style.drawn,
        markersize=3.6,
        linewidth=1.7,
        label=label,
        zorder=2.0,
    )


def _key(axes: Axes) -> None:
    """A legend below the axes, so that it covers no curve; the others come last."""
    entries = sorted(
        zip(*axes.get_legend_handles_labels(), strict=True), key=lambda entry: entry[1] == OTHERS
    )
    axes.legend(
        [handle for handle, _ in entries],
        [label for _, label in entries],
        loc="upper left",
        bbox_to_anchor=(-0.02, -0.15),
        fontsize=8.5,
    )


def _band(counts: Array, totals: Array) -> tuple[Array, Array]:
    """95 % intervals of a density, bin by bin, by bootstrap over rollouts."""
    rng = stream(0, Purpose.BOOTSTRAP)
    times = rng.multinomial(len(totals), np.full(len(totals), 1.0 / len(totals)), size=DRAWS)
    whole = times @ totals
    drawn = (times @ counts)[whole > 0.0] / whole[whole > 0.0][:, None]
    low, high = np.quantile(drawn, [0.025, 0.975], axis=0)
    return np.asarray(low), np.asarray(high)


def _in_cm(name: str, rollouts: Rollouts) -> list[Array]:
    arrays = [100.0 * np.asarray(values, dtype=float).reshape(-1) for values in rollouts]
    finite = [np.asarray(array[np.isfinite(array)]) for array in arrays]
    if not sum(map(len, finite)):
        raise DataError(
            f"distribution figure: replanner {name!r} has no finite value among "
            f"{sum(map(len, arrays))}; evaluate it over longer rollouts"
        )
    return finite


def _edges(width: float, top: float) -> Array:
    """Edges of equal bins from zero to beyond ``top``."""
    return width * np.arange(int(np.floor(top / width)) + 2, dtype=np.float64)


def _quantile(samples: Mapping[str, Array], share: float) -> float:
    return max(float(np.quantile(values, share)) for values in samples.values())
