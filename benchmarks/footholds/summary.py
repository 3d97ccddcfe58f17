"""What walks come to: how near feet step to lines, and what a range of motion costs."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from benchmarks.footholds.families import (
    BOXES,
    DISTANCES,
    FAMILIES,
    REFERENCE_BOX,
    called,
    in_box,
    of_family,
    potentials,
)
from benchmarks.footholds.solves import LIMIT, Walk
from benchmarks.solving.rows import count_reasons
from lmtr.arrays import Array
from lmtr.geometry.line import signed_distance
from lmtr.geometry.se2 import SE2
from lmtr.quality.rules import COST
from lmtr.robot.model import ANYMAL, FEET
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import TaskDistribution, sample_task
from lmtr.task.task import Task

Summary = dict[str, Any]

CLOSE = (0.05, 0.1)
"""Distances (m) below which footholds count as close: the paper's, and the filter's."""

DISTANCE_EDGES = (2.3, 2.7, 3.1, 3.35, 3.6, 3.85)
"""Edges of the bins of goal distances (m)."""

HIND = [FEET.index(foot) for foot in ("LH", "RH")]

TASKS_DRAWN = 5000
"""Tasks that shares of tasks, which need no solves, are taken from."""


def of_group(walks: Sequence[Walk], name: str) -> list[Walk]:
    """Walks of a group, in the order of their tasks."""
    return sorted((walk for walk in walks if walk.group == name), key=lambda walk: walk.index)


def closest(walks: Sequence[Walk]) -> Array:
    """Distance of every line to every foot's closest foothold, (pairs,) in m; converged ones."""
    return np.concatenate([walk.closest.ravel() for walk in walks if walk.converged])


def summarise(walks: Sequence[Walk], drawn: int = TASKS_DRAWN) -> Summary:
    """Everything that tables and the record say."""
    return {
        "families": {
            family: {
                called(potential): _family(of_group(walks, of_family(family, potential)))
                for potential in potentials(family)
            }
            for family in FAMILIES
        },
        "boxes": {f"{box:g}": _box(walks, box) for box in BOXES},
        "uncrossed": {
            family: uncrossed(distribution, drawn) for family, distribution in FAMILIES.items()
        },
    }


def _family(walks: Sequence[Walk]) -> Summary:
    converged = [walk for walk in walks if walk.converged]
    # A foothold counts once, by the line that it is closest to.
    holds = [np.abs(walk.apart).min(axis=0).ravel() for walk in converged]
    nearest = [float(walk.closest.min(initial=np.inf)) for walk in converged]
    close = np.stack([walk.closest for walk in converged]) < CLOSE[1]
    left = [walk for walk in walks if (walk.apart[:, HIND, -1] < 0.0).any()]
    return _outcome(walks) | {
        "closest_foothold": quantiles(nearest),
        "pairs_close": shares_below(closest(walks)),
        "footholds_close": shares_below(np.concatenate(holds)),
        "close_by_line": close.mean(axis=(0, 2)).tolist(),
        "close_by_foot": dict(zip(FEET, close.mean(axis=(0, 1)).tolist(), strict=True)),
        "hind_foot_left": len(left) / len(walks),
        "accepted_of_these": _share_accepted(left) if left else None,
    }


def _outcome(walks: Sequence[Walk]) -> Summary:
    return {
        "tasks": len(walks),
        "converged": float(np.mean([walk.converged for walk in walks])),
        "accepted": _share_accepted(walks),
        "accepted_but_for_cost": float(np.mean([set(w.reasons) <= {COST} for w in walks])),
        "reasons": {
            reason: count
            for reason, (count, _) in count_reasons([{"reasons": w.reasons} for w in walks]).items()
        },
        "cpu_s": float(np.median([walk.cpu_s for walk in walks])),
        "iterations": float(np.median([walk.iterations for walk in walks])),
        "cost": float(np.median([walk.cost for walk in walks])),
    }


def _share_accepted(walks: Sequence[Walk]) -> float:
    return float(np.mean([walk.accepted for walk in walks]))


def shares_below(distances: Array) -> dict[str, float]:
    """Shares of distances (m) below each of ``CLOSE``."""
    return {f"{close:g}": float(np.mean(distances < close)) for close in CLOSE}


def quantiles(values: Sequence[float]) -> dict[str, float]:
    """Least, fifth percentile, median and largest of some values."""
    return {
        "least": float(np.min(values)),
        "p5": float(np.quantile(values, 0.05)),
        "median": float(np.median(values)),
        "largest": float(np.max(values)),
    }


def _box(walks: Sequence[Walk], box: float) -> Summary:
    found: Summary = {}
    for distance in DISTANCES:
        mine = of_group(walks, in_box(box, distance))
        reference = of_group(walks, in_box(REFERENCE_BOX, distance))
        found[distance] = (
            _outcome(mine) | _reach(mine) | {"cost_ratio": paired_cost(mine, reference)}
        )
    both = [walk for distance in DISTANCES for walk in of_group(walks, in_box(box, distance))]
    return found | {"by_distance": by_distance(both)}


def _reach(walks: Sequence[Walk]) -> Summary:
    beyond = [max(0.0, walk.reach - LIMIT) for walk in walks if walk.converged]
    return {
        "reach": quantiles([walk.reach for walk in walks if walk.converged]),
        "beyond_limit": quantiles(beyond),
        "share_beyond_limit": float(np.mean(np.array(beyond) > 0.0)),
        "mean_violation": float(np.mean([walk.violation for walk in walks if walk.converged])),
        "own_overshoot": quantiles([walk.overshoot for walk in walks if walk.converged]),
    }


def paired_cost(walks: Sequence[Walk], reference: Sequence[Walk]) -> float:
    """Median ratio of costs over tasks that both converged on."""
    other = {walk.index: walk.cost for walk in reference if walk.converged}
    ratios = [w.cost / other[w.index] for w in walks if w.converged and w.index in other]
    return float(np.median(ratios)) if ratios else np.nan


def by_distance(walks: Sequence[Walk]) -> list[Summary]:
    """Outcome by goal distance; empty bins are left out."""
    bins = np.digitize([walk.distance for walk in walks], DISTANCE_EDGES)
    found = []
    for number, (low, high) in enumerate(pairwise(DISTANCE_EDGES), 1):
        mine = [walk for walk, at in zip(walks, bins, strict=True) if at == number]
        if mine:
            found.append({"from": low, "to": high} | _outcome(mine))
    return found


def goal_stance_apart(task: Task) -> Array:
    """Signed distance of each foot of the neutral stance at the goal to each line, (n, 4) in m.

    Positive beyond the line.
    """
    feet = SE2.of(task.goal_pose_W).over(1).apply(ANYMAL.nominal_feet_B[:, :2])
    return -signed_distance(task.obstacles_W[:, None], feet)


def uncrossed(distribution: TaskDistribution, count: int) -> Summary:
    """Shares of tasks by where their lines lie at the goal; it takes no solves to tell.

    A line is *left ahead* if no foot in the neutral stance at the goal is beyond it, and
    *straddled* if some are. A foot that would stand nearer than the filter's distance to a line
    there has to give way.
    """
    ahead = straddled = crowded = 0
    for index in range(count):
        task = sample_task(distribution, ANYMAL, stream(0, Purpose.TASK, index))
        apart = goal_stance_apart(task)
        ahead += bool((apart < 0.0).all(axis=1).any())
        straddled += bool(((apart < 0.0).any(axis=1) & (apart > 0.0).any(axis=1)).any())
        crowded += bool((np.abs(apart) < CLOSE[1]).any())
    return {
        "left_ahead": ahead / count,
        "straddled": straddled / count,
        "foot_on_line_at_goal": crowded / count,
    }
