"""Modes of a task: solutions that tread in the same places at the same times.

The distance of two solutions is the larger of two root mean squares: of how far apart their
footholds are, in units of ``FOOTHOLD``, and of how far apart their contact changes are, in units
of ``TIMING``. Complete linkage cut at one makes modes whose diameter these units are: any two
solutions of a mode are nearer to each other than both.
"""

from collections.abc import Sequence

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import squareform

from benchmarks.variety.solves import Walk
from lmtr.arrays import Array, Indices

FOOTHOLD = 0.08
"""Largest root mean square distance of footholds within a mode (m)."""

TIMING = 0.1
"""Largest root mean square difference of contact times within a mode (s)."""


def distances(walks: Sequence[Walk]) -> tuple[Array, Array]:
    """Root mean square distances of footholds (n, n) in m and of contact changes (n, n) in s."""
    feet = np.stack([walk.trajectory.footholds[:, 1:, :2] for walk in walks])
    times = np.stack([walk.trajectory.contact_times[:, 1:-1] for walk in walks])
    apart = ((feet[:, None] - feet[None]) ** 2).sum(axis=-1).mean(axis=(-2, -1))
    late = ((times[:, None] - times[None]) ** 2).mean(axis=(-2, -1))
    return np.sqrt(apart), np.sqrt(late)


def modes(walks: Sequence[Walk], diameter: float = 1.0) -> Indices:
    """Mode of each of the solutions of one task, (n,), from 0 up by the best cost in each.

    Args:
        walks: Solutions of one task.
        diameter: Largest distance within a mode, in the units above.
    """
    if len(walks) < 2:
        return np.zeros(len(walks), dtype=np.intp)
    apart, late = distances(walks)
    units = np.maximum(apart / FOOTHOLD, late / TIMING)
    tree = linkage(squareform(units, checks=False), "complete")
    label = fcluster(tree, diameter, "distance")
    cost = np.array([walk.cost for walk in walks])
    found = sorted(np.unique(label), key=lambda k: cost[label == k].min())
    return np.array([found.index(k) for k in label], dtype=np.intp)
