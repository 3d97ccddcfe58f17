"""Where rollouts start: states of the training distribution (Sec. 5.1).

A nominal static stance is hardly in the data of a replanner that was trained on walking, so a
rollout begins at the epoch of a segment of expert data.
"""

import numpy as np

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.rollout.courses import Course
from lmtr.streams import Purpose, stream


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
    streams = (stream(course.seed, Purpose.START, course.index) for course in courses)
    return np.stack([pool[rng.integers(len(pool))] for rng in streams])
