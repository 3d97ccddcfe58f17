"""Where rollouts start: states of the training distribution (Sec. 5.1).

A nominal static stance is hardly in the data of a replanner that was trained on walking, so a
rollout begins at the epoch of a segment of expert data.
"""

import numpy as np
from numpy.typing import NDArray

from lmtr.errors import DataError
from lmtr.rollout.courses import Course

Array = NDArray[np.float64]


def draw_starts(pool: Array, courses: list[Course]) -> Array:
    """One segment of a pool for each course, drawn by the course's seed and index alone.

    Args:
        pool: Segment vectors τ, (N, 264), best of the validation split.
        courses: The courses that they start on.

    Returns:
        (B, 264).

    Raises:
        DataError: The pool is empty.
    """
    if len(pool) == 0:
        raise DataError("starts: the pool has no segments to draw from; give at least one")
    return np.stack([pool[_stream(course).integers(len(pool))] for course in courses])


def _stream(course: Course) -> np.random.Generator:
    """A stream apart from the one that drew the course's lines."""
    return np.random.default_rng(
        np.random.SeedSequence(entropy=course.seed, spawn_key=(course.index, 1))
    )
