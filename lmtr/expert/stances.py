"""Stance forces as free Bézier points (E4): which there are, and where they stand in a stance.

A stance's force is two cubics (``FORCE_PIECES``), hence seven Bézier points. Where they meet the
force is C¹, so their shared point is the mean of its neighbours and no variable; and next to a
swing the force is at rest, so the two points there are zero. What is left is free: two points
around the middle, and two more at the end of a first or last stance that no swing touches.
"""

from enum import IntEnum
from typing import TypeVar

Point = TypeVar("Point")

MIDDLE_FORCE_POINTS = 2
"""Free points of every stance: the neighbours of the one its two cubics share."""

END_FORCE_POINTS = 2
"""Free points of a stance's end that no swing touches: its node and the node's neighbour."""


class StanceKind(IntEnum):
    """Place of a stance among those of its foot; the first and the last have a free end."""

    FIRST = 0
    MIDDLE = 1
    LAST = 2

    @classmethod
    def of(cls, stance: int, n_stances: int) -> "StanceKind":
        """Kind of one of at least two stances."""
        if stance == 0:
            return cls.FIRST
        return cls.LAST if stance == n_stances - 1 else cls.MIDDLE

    def all_points(self, free: list[Point], zero: Point) -> list[Point]:
        """Points of both cubics but the shared one, in time, from those that are free."""
        at_rest = [zero] * END_FORCE_POINTS
        before = [] if self is StanceKind.FIRST else at_rest
        after = [] if self is StanceKind.LAST else at_rest
        return [*before, *free, *after]


def n_force_points(n_stances: int) -> int:
    """Free Bézier points of one foot's stances."""
    return MIDDLE_FORCE_POINTS * n_stances + 2 * END_FORCE_POINTS


def stance_points(stance: int, n_stances: int) -> slice:
    """Free points of one stance within its foot's row of them, in time."""
    kind = StanceKind.of(stance, n_stances)
    begin = MIDDLE_FORCE_POINTS * stance + (0 if kind is StanceKind.FIRST else END_FORCE_POINTS)
    free_ends = 0 if kind is StanceKind.MIDDLE else END_FORCE_POINTS
    return slice(begin, begin + MIDDLE_FORCE_POINTS + free_ends)
