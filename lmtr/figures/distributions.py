"""The two distributions by which replanners are judged (Fig. 4 a–b, Sec. 5.2)."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.figures.style import FULL_WIDTH, SeriesStyle, Styles, styled, styles_for

DISTANCE_BIN = 2.0
"""Width of a bin of foothold distances (cm)."""

VIOLATION_BIN = 0.5
"""Width of a bin of range-of-motion violations (cm)."""

CLOSE_BAND = "#F1DDE0"
"""Colour behind distances that count as close, and violations that count as severe."""


@styled
def distribution_figure(
    distances: Mapping[str, ArrayLike],
    violations: Mapping[str, ArrayLike],
    close: float = 0.05,
    severe: float = 0.05,
    styles: Styles | None = None,
) -> Figure:
    """Both distributions side by side, one colour per replanner (Fig. 4 a–b).

    Args:
        distances: By replanner, distances (m) of the closest foothold of each foot to each
            obstacle line.
        violations: By replanner, violations (m) of the forward range of motion by each contacting
            foot in each sample; zero where there is none.
        close: A foothold nearer than this (m) counts as close; its share is in the legend.
        severe: A violation beyond this (m) counts as severe.
        styles: Styles of the replanners, if other figures show them too.

    Raises:
        DataError: A replanner is missing in one of the two, or has no finite value.
    """
    if not distances or set(distances) != set(violations):
        raise DataError(
            "distribution figure: distances and violations must name the same replanners, got "
            f"{sorted(distances)} and {sorted(violations)}; evaluate all of them"
        )
    styles = styles_for(distances, styles)
    figure = Figure(figsize=(FULL_WIDTH, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_distances(left, distances, close, styles)
    draw_violations(right, violations, severe, styles)
    return figure


def draw_distances(
    axes: Axes, distances: Mapping[str, ArrayLike], close: float, styles: Styles
) -> None:
    """Fig. 4 a: probability density of the closest foothold's distance; each area is one."""
    samples = {name: 100.0 * _finite(name, values) for name, values in distances.items()}
    top = max(float(values.max()) for values in samples.values())
    edges = _edges(DISTANCE_BIN, top)
    axes.axvspan(0.0, 100.0 * close, color=CLOSE_BAND, lw=0, zorder=0.2)
    for name, values in samples.items():
        density, _ = np.histogram(values, edges, density=True)
        share = 100.0 * float(np.mean(values < 100.0 * close))
        label = f"{name}: {share:.1f} % under {100 * close:g} cm"
        _stairs(axes, density, edges, label, styles[name])
    axes.set_xlim(0.0, DISTANCE_BIN * np.ceil(_quantile(samples, 0.995) / DISTANCE_BIN))
    # Room above the curves for the legend.
    axes.set_ylim(0.0, axes.get_ylim()[1] * (1.0 + 0.09 * len(samples)))
    axes.set_xlabel("distance of the closest foothold to an obstacle line (cm)")
    axes.set_ylabel("probability density (1/cm)")
    axes.set_title("(a) Obstacle avoidance")
    axes.legend(fontsize=8.5, frameon=True, framealpha=0.85, edgecolor="none")


def draw_violations(
    axes: Axes, violations: Mapping[str, ArrayLike], severe: float, styles: Styles
) -> None:
    """Fig. 4 b: density of violations; the axis is zoomed to them, most samples having none.

    The area under a curve is the share of samples with a violation.
    """
    samples = {name: 100.0 * _finite(name, values) for name, values in violations.items()}
    top = max(VIOLATION_BIN, 100.0 * severe, *(float(v.max()) for v in samples.values()))
    edges = _edges(VIOLATION_BIN, top)
    axes.axvline(100.0 * severe, color="#AAAAAA", linestyle=":", zorder=0.3)
    for name, values in samples.items():
        counts, _ = np.histogram(values[values > 0.0], edges)
        density = counts / (len(values) * VIOLATION_BIN)
        share = 100.0 * float(np.mean(values > 100.0 * severe))
        label = f"{name}: mean {10 * values.mean():.2f} mm, {share:.2f} % over {100 * severe:g} cm"
        _stairs(axes, density, edges, label, styles[name])
    right = max(_quantile(samples, 0.9995), 120.0 * severe)
    axes.set_xlim(0.0, VIOLATION_BIN * np.ceil(right / VIOLATION_BIN))
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("violation of the forward range of motion (cm)")
    axes.set_ylabel("probability density, zoomed (1/cm)")
    axes.set_title("(b) Kinematic violation")
    axes.legend(fontsize=8.5, frameon=True, framealpha=0.85, edgecolor="none")


def _stairs(axes: Axes, density: Array, edges: Array, label: str, style: SeriesStyle) -> None:
    axes.stairs(
        density, edges, color=style.colour, linestyle=style.line, linewidth=1.8, label=label
    )


def _finite(name: str, values: ArrayLike) -> Array:
    array = np.asarray(values, dtype=float).reshape(-1)
    finite = np.asarray(array[np.isfinite(array)])
    if not len(finite):
        raise DataError(
            f"distribution figure: replanner {name!r} has no finite value among {len(array)}; "
            "evaluate it over longer rollouts"
        )
    return finite


def _edges(width: float, top: float) -> Array:
    """Edges of equal bins from zero to beyond ``top``."""
    return width * np.arange(int(np.floor(top / width)) + 2, dtype=np.float64)


def _quantile(samples: Mapping[str, Array], share: float) -> float:
    return max(float(np.quantile(values, share)) for values in samples.values())
