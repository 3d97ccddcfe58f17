"""What the solves come to: modes of each task, what they cost, how they differ, and how sure it is.

Where costs and characters are compared, each mode stands with its best solution.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from benchmarks.variety.character import DIFFERENCES, Character, character, differing
from benchmarks.variety.clusters import FOOTHOLD, TIMING, distances, modes
from benchmarks.variety.solves import Kind, Walk
from lmtr.arrays import Array, Indices

DIAMETERS = (0.5, 0.75, 1.0, 1.25, 1.5)
"""Diameters of modes, in their units, for which modes are counted."""

NEAR_BEST = 0.1
"""Cost over the best of the task up to which a mode counts as about as good."""


@dataclass(frozen=True)
class TaskModes:
    """The accepted solutions of one task.

    Attributes:
        index: Number of the task.
        solved: Draws that were solved.
        walks: Accepted solutions, n of them.
        label: Mode of each, (n,), by the best cost in each.
        characters: What each is like.
    """

    index: int
    solved: int
    walks: list[Walk]
    label: Indices
    characters: list[Character]

    @property
    def count(self) -> int:
        """Number of modes."""
        return len(set(self.label.tolist()))

    @property
    def costs(self) -> Array:
        """Costs, (n,)."""
        return np.array([walk.cost for walk in self.walks])

    @property
    def best(self) -> list[int]:
        """Place of the best solution of each mode."""
        return [self.members(k)[int(self.costs[self.label == k].argmin())] for k in self.modes]

    @property
    def modes(self) -> range:
        """The modes."""
        return range(self.count)

    def members(self, mode: int) -> list[int]:
        """Places of a mode's solutions."""
        return np.flatnonzero(self.label == mode).tolist()


def task_modes(walks: Sequence[Walk]) -> list[TaskModes]:
    """Modes of every task of which a solution was accepted."""
    draws = [walk for walk in walks if walk.kind == Kind.DRAW]
    found = []
    for index in sorted({walk.index for walk in draws}):
        mine = [walk for walk in draws if walk.index == index]
        kept = [walk for walk in mine if walk.accepted]
        if kept:
            looks = [character(walk) for walk in kept]
            found.append(TaskModes(index, len(mine), kept, modes(kept), looks))
    return found


def summarise(walks: Sequence[Walk], tasks: Sequence[TaskModes]) -> dict[str, Any]:
    """Everything, for a file."""
    return {
        "unit": {"footholds_m": FOOTHOLD, "contact_times_s": TIMING},
        "solves": _solves(walks),
        "modes": _modes(tasks),
        "costs": _costs(tasks),
        "pairs_of_modes_that_differ_in": _differences(tasks),
        "characters": _characters(tasks),
        "gait": _gait(walks),
        "checks": {**_gap(tasks), **_checks(walks)},
        "tasks": [_task(task) for task in tasks],
    }


def _solves(walks: Sequence[Walk]) -> dict[str, Any]:
    draws = [walk for walk in walks if walk.kind == Kind.DRAW]
    reasons = Counter(reason for walk in draws for reason in walk.reasons)
    return {
        "tasks": len({walk.index for walk in draws}),
        "draws": len(draws),
        "accepted": float(np.mean([walk.accepted for walk in draws])),
        "window_active": float(np.mean([walk.window_active for walk in draws])),
        "iterations_median": float(np.median([walk.iterations for walk in draws])),
        "cpu_s_median": float(np.median([walk.cpu_s for walk in draws])),
        "reasons": {reason: count / len(draws) for reason, count in reasons.most_common()},
    }


def _modes(tasks: Sequence[TaskModes]) -> dict[str, Any]:
    counts = [task.count for task in tasks]
    largest = [np.bincount(task.label).max() / len(task.walks) for task in tasks]
    near = [
        int((task.costs[task.best] <= (1 + NEAR_BEST) * task.costs.min()).sum()) for task in tasks
    ]
    ways = [len({look.crossing_swings for look in task.characters}) for task in tasks]
    several = [int((np.bincount(task.label) > 1).sum()) for task in tasks]
    return {
        "median": float(np.median(counts)),
        "fewest": min(counts),
        "most": max(counts),
        "median_found_more_than_once": float(np.median(several)),
        "median_near_best": float(np.median(near)),
        "median_ways_over_the_lines": float(np.median(ways)),
        "median_share_of_largest": float(np.median(largest)),
        "median_by_diameter": {
            f"{d:g}": float(np.median([len(set(modes(t.walks, d).tolist())) for t in tasks]))
            for d in DIAMETERS
        },
    }


def _costs(tasks: Sequence[TaskModes]) -> dict[str, float]:
    """Differences of costs as shares of the task's best, within modes and between them."""
    within, between = [], []
    for task in tasks:
        for a, b in combinations(range(len(task.walks)), 2):
            gap = abs(task.costs[a] - task.costs[b]) / task.costs.min()
            (within if task.label[a] == task.label[b] else between).append(gap)
    over = [task.costs[task.best[1:]] / task.costs.min() - 1.0 for task in tasks]
    return {
        "median_difference_within_modes": _median(within),
        "median_difference_between_modes": _median(between),
        "median_mode_over_best": _median(np.concatenate([*over, []]).tolist()),
    }


def _differences(tasks: Sequence[TaskModes]) -> dict[str, float]:
    pairs = [
        differing(task.characters[a], task.characters[b])
        for task in tasks
        for a, b in combinations(task.best, 2)
    ]
    return {name: float(np.mean([pair[name] for pair in pairs])) for name in DIFFERENCES if pairs}


def _characters(tasks: Sequence[TaskModes]) -> dict[str, dict[str, float]]:
    """Medians over tasks of the least and the greatest among a task's modes."""
    figures: dict[str, Callable[[Character], float]] = {
        "mean_step_over_lines_m": lambda c: c.mean_step,
        "footholds_between_lines": lambda c: c.between,
        "share_of_time_on_two_feet": lambda c: c.two_feet,
    }
    found = {}
    for name, figure in figures.items():
        values = [[figure(task.characters[k]) for k in task.best] for task in tasks]
        found[name] = {
            "least": float(np.median([min(row) for row in values])),
            "greatest": float(np.median([max(row) for row in values])),
        }
    return found


def _gait(walks: Sequence[Walk]) -> dict[str, float]:
    swaps = np.array(
        [walk.liftoff_swaps for walk in walks if walk.kind == Kind.DRAW and walk.accepted]
    )
    return {
        "solutions_with_another_order_than_the_guess": float((swaps > 0).mean()),
        "median_swaps": float(np.median(swaps)),
        "mean_swaps": float(swaps.mean()),
        "most_swaps": int(swaps.max()),
    }


def _gap(tasks: Sequence[TaskModes]) -> dict[str, Any]:
    """Whether feet that cross with the same swings tread in the same places, and others do not.

    Among guesses that begin with the same foot; another one puts all feet elsewhere anyway.
    """
    same, other = [], []
    for task in tasks:
        apart, _ = distances(task.walks)
        for a, b in combinations(range(len(task.walks)), 2):
            one, two = task.walks[a], task.walks[b]
            alike = task.characters[a].crossing_swings == task.characters[b].crossing_swings
            if one.first == two.first:
                (same if alike else other).append(float(apart[a, b]))
    return {
        "foothold_distance_same_crossing_swings_p95_m": _quantile(same, 0.95),
        "foothold_distance_other_crossing_swings_p05_m": _quantile(other, 0.05),
    }


def _checks(walks: Sequence[Walk]) -> dict[str, Any]:
    """Distances of solves that an early stop, or a nudge of the guess, may have set apart."""
    by_kind = {kind: {(w.index, w.draw): w for w in walks if w.kind == kind} for kind in Kind}
    return {
        "early_stop_to_optimum": _pairs(by_kind[Kind.DRAW], by_kind[Kind.STRICT]),
        "nudged": _pairs(by_kind[Kind.DRAW], by_kind[Kind.NUDGED]),
        "nudged_both_at_optimum": _pairs(by_kind[Kind.STRICT], by_kind[Kind.NUDGED_STRICT]),
    }


Walks = dict[tuple[int, int], Walk]


def _pairs(one: Walks, other: Walks) -> dict[str, float]:
    pairs = [(one[key], other[key]) for key in other]
    apart = [tuple(float(m[0, 1]) for m in distances(pair)) for pair in pairs]
    feet, times = (np.array(column) for column in zip(*apart, strict=True))
    near = (feet <= FOOTHOLD) & (times <= TIMING)
    costs = np.array([abs(a.cost - b.cost) / min(a.cost, b.cost) for a, b in pairs])
    return {
        "pairs": len(pairs),
        "same_mode": float(near.mean()),
        "median_foothold_distance_m": float(np.median(feet)),
        "largest_foothold_distance_within_m": float(feet[near].max(initial=0.0)),
        "median_timing_distance_s": float(np.median(times)),
        "median_cost_difference": float(np.median(costs)),
    }


def _task(task: TaskModes) -> dict[str, Any]:
    return {
        "index": task.index,
        "solved": task.solved,
        "accepted": len(task.walks),
        "modes": [_mode(task, mode) for mode in task.modes],
    }


def _mode(task: TaskModes, mode: int) -> dict[str, Any]:
    members = task.members(mode)
    look = task.characters[task.best[mode]]
    return {
        "size": len(members),
        "best_cost": float(task.costs[members].min()),
        "spread_of_cost": float(np.ptp(task.costs[members])),
        "swings_over_lines": [list(row) for row in look.crossing_swings],
        "order_over_lines": [list(row) for row in look.crossing_order],
        "mean_steps_over_lines_m": [round(step, 3) for step in look.crossing_steps],
        "footholds_between_lines": look.between,
        "share_of_time_on_two_feet": round(look.two_feet, 3),
        "liftoff_swaps": [task.walks[k].liftoff_swaps for k in members],
    }


def _median(values: Sequence[float]) -> float:
    return _quantile(values, 0.5)


def _quantile(values: Sequence[float], level: float) -> float:
    return float(np.quantile(values, level)) if len(values) else float("nan")
