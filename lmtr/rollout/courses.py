"""Random courses of obstacle lines along the world's x axis (Sec. 5.1).

A course depends on its seed and index alone: every replanner meets the same ones, whatever the
size or the order of the batch in which it runs.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from lmtr.arrays import Array
from lmtr.errors import ConfigurationError
from lmtr.rollout.settings import RolloutSettings
from lmtr.streams import Purpose, stream


@dataclass(frozen=True)
class Course:
    """The obstacle lines of one rollout.

    Attributes:
        seed: Seed of the set of courses.
        index: Which course of the set; also the rollout's index.
        obstacles_W: Lines (x, y, α), (n, 3) in m and rad, by ascending x; y = 0.
    """

    seed: int
    index: int
    obstacles_W: Array


def random_course(settings: RolloutSettings, seed: int, index: int) -> Course:
    """Draw course ``index``: forward spacing and orientation of its lines are uniform.

    A course for a longer duration begins with the lines of a shorter one.
    """
    rng = stream(seed, Purpose.COURSE, index)
    # One row of draws a line: later lines cannot change earlier ones.
    gap, turn = rng.uniform(size=(settings.n_lines, 2)).T
    low, high = settings.obstacle_spacing
    first_low, first_high = settings.first_obstacle
    gaps = low + (high - low) * gap
    gaps[0] = first_low + (first_high - first_low) * gap[0]
    lines = np.zeros((settings.n_lines, 3))
    lines[:, 0] = np.cumsum(gaps)
    lines[:, 2] = np.pi / 2.0 + (2.0 * turn - 1.0) * settings.obstacle_turn
    return Course(seed, index, lines)


def random_courses(settings: RolloutSettings, seed: int, indices: Iterable[int]) -> list[Course]:
    """The courses of these indices."""
    return [random_course(settings, seed, index) for index in indices]


def obstacle_array(courses: list[Course]) -> Array:
    """Lines of all courses as one array (B, n, 3).

    Raises:
        ConfigurationError: The courses have different numbers of lines.
    """
    counts = sorted({len(course.obstacles_W) for course in courses})
    if len(counts) > 1:
        raise ConfigurationError(
            f"courses: all must have the same number of lines to run in one batch, got {counts}; "
            "draw them with the same settings"
        )
    return np.stack([course.obstacles_W for course in courses])
