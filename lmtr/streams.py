"""Random streams, one for each purpose and index under a seed.

Whatever is drawn depends on its seed, purpose and index alone: the same in any number of workers
and in any order, and independent of all that is drawn for another purpose under the same seed.
"""

from enum import IntEnum

import numpy as np


class Purpose(IntEnum):
    """What a stream is for. The numbers are part of every draw: append, never renumber."""

    TASK = 0
    """Task and noise of a solution, by its index in the data set."""

    SEGMENTS = 1
    """Epochs and goals of a solution's segments, by the solution's index."""

    COURSE = 2
    """Obstacle lines of a rollout, by the course's index."""

    START = 3
    """Where a rollout starts, by the course's index."""

    PRIOR = 4
    """Modes from the prior, by a digest of the task."""

    BOOTSTRAP = 5
    """Resampling of motions for confidence intervals."""

    TRAINING_ROWS = 6
    """Which training segments are learnt from, if not all are."""

    REFERENCE = 7
    """Noise of the expert's solves on a rollout's course, by the course's index."""


def stream(seed: int, purpose: Purpose, index: int = 0) -> np.random.Generator:
    """The random stream of ``index`` for a purpose, independent of all others."""
    key = (int(purpose), index)
    return np.random.default_rng(np.random.SeedSequence(entropy=seed, spawn_key=key))
