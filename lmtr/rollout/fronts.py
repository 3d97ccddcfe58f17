"""Fronts of two rates that shall both be small, such as close steps and violation (Fig. 4c).

A point is one weight vector w: its share of close steps first, its kinematic violation second.
"""

import numpy as np

from lmtr.arrays import Array, Flags, Indices
from lmtr.errors import ConfigurationError


def pareto_front(points: Array) -> Indices:
    """Indices of the points that no other one is at least as good as in both rates.

    Args:
        points: (n, 2), smaller is better; those with NaN are on no front. Of equal points the
            first is kept.

    Returns:
        By ascending first rate, hence by descending second rate.
    """
    points = _pairs(points)
    judged = np.flatnonzero(np.isfinite(points).all(axis=1))
    order = judged[np.lexsort((points[judged, 1], points[judged, 0]))]
    second = points[order, 1]
    best_before = np.concatenate([[np.inf], np.minimum.accumulate(second)[:-1]])
    return np.asarray(order[second < best_before], dtype=np.intp)


def spread_along(front: Array, count: int) -> Indices:
    """Indices of at most ``count`` points of a front, both ends first, evenly along its length.

    Args:
        front: (m, 2), in order along the front.
        count: How many at most; one alone is the point nearest to the middle.

    Returns:
        Ascending. Rates count in units of their range, so that neither outweighs the other.
    """
    front = _pairs(front)
    if count < 1:
        raise ConfigurationError(f"front: count must be at least 1, got {count}; ask for a point")
    if len(front) <= count:
        return np.arange(len(front))
    extent = np.ptp(front, axis=0)
    steps = np.diff(front / np.where(extent > 0.0, extent, 1.0), axis=0)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*steps.T))])
    wanted = along[-1] * (np.linspace(0.0, 1.0, count) if count > 1 else np.array([0.5]))
    taken: list[int] = []
    for place, position in enumerate(wanted):
        # Enough points must be left for the places to come.
        free = np.arange(taken[-1] + 1 if taken else 0, len(front) - (count - 1 - place))
        taken.append(int(free[np.argmin(np.abs(along[free] - position))]))
    return np.array(taken, dtype=np.intp)


def chosen(points: Array, fallen: Flags, count: int) -> Indices:
    """Indices of at most ``count`` points to keep: spread along the front of those without falls.

    Args:
        points: (n, 2), smaller is better.
        fallen: Whether a rollout diverged there, (n,); such points are left out unless all are.
        count: How many at most.
    """
    points, fallen = _pairs(points), np.asarray(fallen, dtype=bool)
    usable = np.flatnonzero(~fallen & np.isfinite(points).all(axis=1))
    if len(usable) == 0:
        usable = np.arange(len(points))
    front = usable[pareto_front(points[usable])]
    return np.asarray(front[spread_along(points[front], count)], dtype=np.intp)


def interpolated(points: Array, levels: Array) -> Array:
    """The second rate at levels of the first, piecewise linear through the points.

    Args:
        points: (..., m, 2) in any order; points with NaN are left out of all.
        levels: (k,).

    Returns:
        (..., k); NaN outside of the points' range: nothing is extrapolated.
    """
    points, levels = np.asarray(points, dtype=float), np.asarray(levels, dtype=float)
    flat = points.reshape(-1, *points.shape[-2:])
    values = np.stack([_through(each, levels) for each in flat])
    return np.asarray(values.reshape(*points.shape[:-2], len(levels)))


def _through(points: Array, levels: Array) -> Array:
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) == 0:
        return np.full(len(levels), np.nan)
    # Of points with the same first rate the better one counts.
    points = points[np.lexsort((points[:, 1], points[:, 0]))]
    points = points[np.concatenate([[True], np.diff(points[:, 0]) > 0.0])]
    return np.asarray(
        np.interp(levels, points[:, 0], points[:, 1], left=float("nan"), right=float("nan"))
    )


def _pairs(points: Array) -> Array:
    points = np.asarray(points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 2:
        raise ConfigurationError(
            f"front: points must be pairs of rates (n, 2), got shape {points.shape}; "
            "stack the two rates as columns"
        )
    return points
