"""The figures that the expert is judged by, and what they should reach."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from benchmarks.solving.rows import Row
from benchmarks.solving.statistics import (
    Among,
    Statistic,
    cpu_per_accepted,
    cpu_per_iteration,
    mean,
    median,
    quantile,
    share,
    unknown,
)

Summary = dict[str, float]
"""The value of each figure by its key, in SI units; NaN where there is none."""

Bound = float | tuple[float, float]
"""A bound on the better side, or the band that the figure should lie in."""


class Better(StrEnum):
    """Which way a figure improves."""

    LOWER = "lower"
    HIGHER = "higher"
    NEITHER = "neither"


@dataclass(frozen=True)
class Goal:
    """What a figure must reach, what it should reach, and what TOWR reaches, for orientation."""

    target: Bound | None = None
    stretch: Bound | None = None
    peer: str = ""


EXACT = 1e-4
"""Weights: what holds for all times holds to the solver's tolerance."""

GOALS = {
    "cpu_s": Goal(0.5, 0.25, "7.7"),
    "cpu_s_p90": Goal(peer="≤ 10.0"),
    "cpu_s_per_accepted": Goal(0.65, 0.35),
    "iterations": Goal(peer="23"),
    "converged": Goal(0.98, 0.995),
    "accepted": Goal((0.70, 0.90)),
    "linear_residual": Goal(0.35, 0.15, "0.37–0.8"),
    "angular_residual": Goal(1.5, 0.5),
    "stance_overshoot": Goal(peer="20"),
    "stance_overshoot_max": Goal(0.010, 0.003),
    "swing_overshoot_max": Goal(0.010, 0.003),
    "friction_excess": Goal(EXACT),
    "pull": Goal(EXACT),
    "drift": Goal(0.010, 0.003),
    "setup_s": Goal(60.0, 15.0),
}
"""In SI units, forces in weights of the robot."""

PEER = (
    "TOWR's figures (C++, ANYmal) were measured on another machine, so its times tell no more than "
    "an order of magnitude. It solved an easier problem: the same walk with free phase durations, "
    "but no cost and no obstacles. Its angular residual peaks at 5 to 6 N·m and more."
)


@dataclass(frozen=True)
class Unit:
    """What a figure is shown in, and how many of it make up its SI unit."""

    symbol: str = ""
    per_si: float = 1.0


NUMBER, WEIGHTS, PERCENT = Unit(), Unit("weights"), Unit("%", 100.0)
SECONDS, MILLISECONDS, MILLIMETRES = Unit("s"), Unit("ms", 1e3), Unit("mm", 1e3)
LINEAR, ANGULAR = Unit("m/s²"), Unit("rad/s²")


@dataclass(frozen=True)
class Figure:
    """One line of the table: a key for files, a label for people, and how it comes from rows."""

    key: str
    label: str
    unit: Unit
    statistic: Statistic
    better: Better = Better.LOWER

    @property
    def goal(self) -> Goal:
        """What it should reach."""
        return GOALS.get(self.key, Goal())

    @property
    def timed(self) -> bool:
        """Whether it depends on the machine."""
        return self.unit in (SECONDS, MILLISECONDS)

    def reaches(self, value: float, bound: Bound | None) -> bool | None:
        """Whether a value keeps a bound; none if there is no bound or no value."""
        if bound is None or np.isnan(value):
            return None
        if isinstance(bound, tuple):
            return bound[0] <= value <= bound[1]
        return value >= bound if self.better == Better.HIGHER else value <= bound


CONVERGED, ACCEPTED = Among.CONVERGED, Among.ACCEPTED
HIGHER, NEITHER = Better.HIGHER, Better.NEITHER

LINEAR_PEAK, ANGULAR_PEAK = "linear_residual_peak", "angular_residual_peak"
STANCE, SWING, CLOSEST = "stance_overshoot", "swing_overshoot", "closest_foothold"

FRICTION = quantile("friction_excess", 1.0, CONVERGED)
LEAST_DISTANCE = quantile(CLOSEST, 0.0, ACCEPTED)

FIGURES = (
    Figure("cpu_s", "CPU per solve, median", SECONDS, median("cpu_s")),
    Figure("cpu_s_p90", "CPU per solve, p90", SECONDS, quantile("cpu_s", 0.9)),
    Figure("cpu_s_per_accepted", "CPU of all over accepted", SECONDS, cpu_per_accepted),
    Figure("cpu_s_accepted", "CPU of an accepted, median", SECONDS, median("cpu_s", ACCEPTED)),
    Figure("iterations", "iterations, median", NUMBER, median("iterations")),
    Figure("iterations_p90", "iterations, p90", NUMBER, quantile("iterations", 0.9)),
    Figure("cpu_s_per_iteration", "CPU per iteration", MILLISECONDS, cpu_per_iteration),
    Figure("setup_s", "set-up of the compiled problem", SECONDS, unknown),
    Figure("converged", "converged", PERCENT, share("converged"), HIGHER),
    Figure("accepted", "accepted", PERCENT, share("accepted"), NEITHER),
    Figure("cost", "cost, median", NUMBER, median("cost", CONVERGED)),
    Figure("linear_residual", "linear residual peak", LINEAR, median(LINEAR_PEAK, CONVERGED)),
    Figure("linear_residual_p90", "… its p90", LINEAR, quantile(LINEAR_PEAK, 0.9, CONVERGED)),
    Figure("angular_residual", "angular residual peak", ANGULAR, median(ANGULAR_PEAK, CONVERGED)),
    Figure("angular_residual_p90", "… its p90", ANGULAR, quantile(ANGULAR_PEAK, 0.9, CONVERGED)),
    Figure("stance_overshoot", "stance foot out of its box", MILLIMETRES, median(STANCE, ACCEPTED)),
    Figure("stance_overshoot_max", "… most", MILLIMETRES, quantile(STANCE, 1.0, ACCEPTED)),
    Figure("swing_overshoot", "swing foot out of its box", MILLIMETRES, median(SWING, ACCEPTED)),
    Figure("swing_overshoot_max", "… most", MILLIMETRES, quantile(SWING, 1.0, ACCEPTED)),
    Figure("friction_excess", "friction exceeded, most", WEIGHTS, FRICTION),
    Figure("pull", "pull at the ground, most", WEIGHTS, quantile("pull", 1.0, CONVERGED)),
    Figure("drift", "drift over 0.8 s of forces", MILLIMETRES, median("drift", CONVERGED)),
    Figure(CLOSEST, "closest foothold to a line", MILLIMETRES, median(CLOSEST, ACCEPTED), HIGHER),
    Figure("closest_foothold_min", "… least", MILLIMETRES, LEAST_DISTANCE, HIGHER),
    Figure("liftoff_swaps", "lift-offs swapped, mean", NUMBER, mean("liftoff_swaps"), NEITHER),
    Figure("any_swap", "solves with swapped lift-offs", PERCENT, share("liftoff_swaps"), NEITHER),
    Figure("window_active", "solves that touch a window", PERCENT, share("window_active")),
)
"""Residuals and overshoots are on a 5 ms grid, medians over solutions if nothing else is said."""


def summarise(rows: Sequence[Row], setup_s: float) -> Summary:
    """Every figure; ``setup_s`` is NaN where nothing was compiled."""
    return {figure.key: figure.statistic(rows) for figure in FIGURES} | {"setup_s": setup_s}
