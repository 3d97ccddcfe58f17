"""What a mode tells of its segment: how much of a property is known once z is (Sec. 4.3, Fig. 2).

Both shares ask the nearest modes, so that they see any smooth dependence and not only linear ones.
They are zero where the mode says nothing, and at most one.
"""

import numpy as np
from scipy.spatial import cKDTree

from lmtr.arrays import Array, Indices
from lmtr.errors import DataError

NEIGHBOURS = 15
"""Modes that are asked; more blur, fewer add noise of one part in so many."""


def variance_explained(modes: Array, values: Array, neighbours: int = NEIGHBOURS) -> float:
    """Share of the variance of a property that the mean over the nearest other modes explains.

    Args:
        modes: (N, n).
        values: The property of each segment, (N,).
        neighbours: How many others are asked.

    Returns:
        1 − residual over total variance, at least 0; NaN if the property does not vary.

    Raises:
        DataError: Too few modes, or values of another length.
    """
    near = _nearest(modes, values, neighbours)
    total = float(np.var(values))
    if total <= 0.0:
        return float("nan")
    # The mean of k others is itself uncertain by 1/k of what remains unexplained.
    residual = float(np.mean((values - values[near].mean(axis=1)) ** 2))
    return max(0.0, 1.0 - residual / (1.0 + 1.0 / neighbours) / total)


def choice_explained(modes: Array, choices: Indices, neighbours: int = NEIGHBOURS) -> float:
    """Share of the wrong guesses of a choice that the vote of the nearest other modes avoids.

    Args:
        modes: (N, n).
        choices: The choice of each segment, such as the foot that lifts first, (N,) from 0 on.
        neighbours: How many others vote.

    Returns:
        (a − a₀)/(1 − a₀), at least 0, with the votes' accuracy a and that of the most common choice
        a₀; NaN if all chose the same.

    Raises:
        DataError: Too few modes, or choices of another length.
    """
    near = _nearest(modes, choices, neighbours)
    counts = np.bincount(choices)
    commonest = float(counts.max() / counts.sum())
    if commonest >= 1.0:
        return float("nan")
    votes = (choices[near][..., None] == np.arange(len(counts))).sum(axis=1)
    accuracy = float(np.mean(votes.argmax(axis=1) == choices))
    return max(0.0, (accuracy - commonest) / (1.0 - commonest))


def _nearest(modes: Array, values: Array | Indices, neighbours: int) -> Indices:
    """Rows of the nearest other modes, (N, k)."""
    if len(modes) != len(values) or len(modes) <= neighbours or modes.shape[1] < 1:
        raise DataError(
            f"mode content: needs more than {neighbours} modes with one value each, got modes "
            f"{modes.shape} and {len(values)} values; encode more segments"
        )
    _, rows = cKDTree(modes).query(modes, neighbours + 1)
    return np.asarray(rows[:, 1:], dtype=np.intp)
