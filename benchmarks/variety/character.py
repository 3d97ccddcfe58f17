"""What a solution is like: where, with which steps and in which order its feet cross the lines."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from benchmarks.variety.solves import Walk
from lmtr.arrays import Array, Indices
from lmtr.geometry.line import signed_distance
from lmtr.robot.model import FEET
from lmtr.trajectory.sample import sample_feet

SAMPLE_STEP = 0.005
"""Spacing of the samples at which feet on the ground are counted (s)."""

LONGER_STEP = 0.05
"""Difference of mean crossing steps (m) from which on one mode steps longer than another."""

MORE_OVERLAP = 0.05
"""Difference of shares of time on two feet, likewise."""


@dataclass(frozen=True)
class Character:
    """What a solution is like.

    Attributes:
        crossing_swings: Number of the swing with which each foot crosses each line, (n, 4).
        crossing_order: For each line, feet in the order in which they come down beyond it.
        crossing_steps: Mean length of the four steps over each line, (n,) in m.
        between: Footholds between the first and the last line.
        two_feet: Share of the time with two feet down or fewer.
        liftoffs: Feet in the order of all lift-offs.
    """

    crossing_swings: tuple[tuple[int, ...], ...]
    crossing_order: tuple[tuple[str, ...], ...]
    crossing_steps: tuple[float, ...]
    between: int
    two_feet: float
    liftoffs: tuple[str, ...]

    @cached_property
    def mean_step(self) -> float:
        """Mean length of all steps over lines (m)."""
        return float(np.mean(self.crossing_steps))


def character(walk: Walk) -> Character:
    """Look at one solution."""
    trajectory, lines = walk.trajectory, walk.obstacles_W
    # Lines are directed to the left of the path, so the side beyond them has negative distance.
    beyond = signed_distance(lines[:, None, None], trajectory.footholds) < 0.0  # (n, 4, S)
    swing = beyond.argmax(axis=-1) - 1
    lengths = np.linalg.norm(np.diff(trajectory.footholds[..., :2], axis=1), axis=-1)
    step = np.take_along_axis(lengths[None], swing[..., None], axis=-1)[..., 0]
    landing = np.take_along_axis(trajectory.touchdown_times[None], swing[..., None], axis=-1)
    between = beyond[0] & ~beyond[-1]
    return Character(
        crossing_swings=tuple(tuple((row + 1).tolist()) for row in swing),
        crossing_order=tuple(tuple(_names(row)) for row in landing[..., 0].argsort(axis=-1)),
        crossing_steps=tuple(step.mean(axis=-1).tolist()),
        between=int(between.sum()),
        two_feet=_two_feet(walk),
        liftoffs=tuple(_liftoffs(trajectory.liftoff_times)),
    )


DIFFERENCES = {
    "which swing crosses a line": lambda a, b: a.crossing_swings != b.crossing_swings,
    "which foot crosses a line first": lambda a, b: any(
        one[0] != other[0] for one, other in zip(a.crossing_order, b.crossing_order, strict=True)
    ),
    "order of feet over a line": lambda a, b: a.crossing_order != b.crossing_order,
    "footholds between the lines": lambda a, b: a.between != b.between,
    f"mean step over a line, by {100 * LONGER_STEP:.0f} cm or more": lambda a, b: bool(
        (np.abs(np.subtract(a.crossing_steps, b.crossing_steps)) >= LONGER_STEP).any()
    ),
    f"share of time on two feet, by {100 * MORE_OVERLAP:.0f} points or more": lambda a, b: (
        abs(a.two_feet - b.two_feet) >= MORE_OVERLAP
    ),
    "order of lift-offs": lambda a, b: a.liftoffs != b.liftoffs,
}
"""Ways in which two modes differ, by name."""


def differing(one: Character, other: Character) -> dict[str, bool]:
    """Which of the differences there are between two solutions."""
    return {name: bool(differ(one, other)) for name, differ in DIFFERENCES.items()}


def _two_feet(walk: Walk) -> float:
    end = float(walk.trajectory.base_end)
    times: Array = SAMPLE_STEP * np.arange(round(end / SAMPLE_STEP), dtype=np.float64)
    return float((sample_feet(walk.trajectory, times).contact.sum(axis=-1) <= 2).mean())


def _liftoffs(times: Array) -> list[str]:
    feet = np.repeat(np.arange(len(times)), times.shape[1])
    return _names(feet[times.ravel().argsort(kind="stable")])


def _names(feet: Indices | Sequence[int]) -> list[str]:
    return [FEET[int(foot)] for foot in feet]
