"""Contact changes of one replanning window, where plan and accumulated motion may disagree.

At each replanning the accumulated motion says which feet stand; the plan has a phase sequence
stance, swing, stance of its own, and a regressor or a library may put the epoch into another phase
than the one that the foot is really in. The accumulated motion is what has happened, so it wins;
the contact change of the plan that lies nearest to the epoch in time is taken to be the one that
the two disagree about, and it is carried out or dropped so that they agree again:

===========  ===================  =================  ==============================================
foot really  in the plan          nearest change     what happens
===========  ===================  =================  ==============================================
stands       first stance         –                  lifts off and touches down as planned
stands       swing                lift-off (past)    ``LIFTS_LATE``: it lifts off at once
stands       swing                touch-down         ``LANDED_EARLY``: it stays where it stands
stands       second stance        –                  it stays where it stands
swings       swing                –                  touches down as planned
swings       second stance        touch-down (past)  ``LANDS_LATE`` on the second foothold
swings       first stance         its start          ``LANDS_LATE`` on the first foothold
swings       first stance         lift-off           ``LIFTED_EARLY``: it swings on to the second
===========  ===================  =================  ==============================================

A late landing takes ``landing_time``, for the foot is still in the air.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from lmtr.arrays import Array, Flags
from lmtr.trajectory.trajectory import Trajectory

SAME_TIME = 1e-6
"""Times (s) closer than this are equal: rounding alone must not make a disagreement."""


class Disagreement(IntEnum):
    """How a plan and the accumulated motion differ about a foot's contact at the epoch."""

    NONE = 0
    LIFTS_LATE = 1
    LANDED_EARLY = 2
    LANDS_LATE = 3
    LIFTED_EARLY = 4


@dataclass(frozen=True)
class Feet:
    """The feet of n robots as the accumulated motion has them at one instant.

    Attributes:
        stands: Whether each foot stands, (n, 4).
        position_W: Where each foot is, in stance where it touched down, (n, 4, 3) in m.
        time_since_liftoff: Seconds since its real lift-off, 0 in stance, (n, 4).
    """

    stands: Flags
    position_W: Array
    time_since_liftoff: Array


@dataclass(frozen=True)
class ContactSchedule:
    """What n × 4 feet do from the epoch on; times (n, 4) in s after it, ∞ for never.

    Attributes:
        landing: Touch-down on the plan's first foothold, of a foot that is late on it.
        liftoff: Lift-off towards the plan's second foothold.
        touchdown: Touch-down on the plan's second foothold.
        disagreement: The :class:`Disagreement` settled, (n, 4).
    """

    landing: Array
    liftoff: Array
    touchdown: Array
    disagreement: NDArray[np.int8]


def schedule(plan: Trajectory, feet: Feet, landing_time: float, window: float) -> ContactSchedule:
    """Settle what the feet do during one replanning window.

    Args:
        plan: Segments (n) with time counted from the epoch.
        feet: The feet at the epoch.
        landing_time: How long a late foot takes to the ground (s).
        window: Length of the replanning window; a change within rounding of its end is put on
            it and belongs to the window (s).
    """
    start = plan.contact_times[..., 0]
    liftoff, touchdown = plan.liftoff_times[..., 0], plan.touchdown_times[..., 0]
    stands, swings = feet.stands, ~feet.stands
    in_first, in_second = liftoff > 0.0, touchdown <= 0.0
    in_swing = ~in_first & ~in_second
    lifts_late = stands & in_swing & (-liftoff < touchdown)
    landed_early = stands & in_swing & ~lifts_late
    # A first stance that begins shortly after the epoch is landed on at that time, not before.
    landing = np.where(start > 0.0, start, landing_time)
    lands_on_first = swings & in_first & (np.abs(start) < liftoff) & (landing < liftoff)
    lifted_early = swings & in_first & ~lands_on_first
    lands_on_second = swings & in_second
    stays = landed_early | (stands & in_second)
    change = np.minimum(np.abs(liftoff), np.abs(touchdown))
    disagreement = np.select(
        [
            lifts_late & (change > SAME_TIME),
            landed_early & (change > SAME_TIME),
            lands_on_first | lands_on_second,
            lifted_early & (change > SAME_TIME),
        ],
        [
            Disagreement.LIFTS_LATE,
            Disagreement.LANDED_EARLY,
            Disagreement.LANDS_LATE,
            Disagreement.LIFTED_EARLY,
        ],
        Disagreement.NONE,
    )
    lifts = (stands & in_first) | lands_on_first
    landing = np.where(lands_on_first, landing, np.inf)
    liftoff = np.where(lifts, liftoff, np.where(lifts_late, 0.0, np.inf))
    touchdown = np.where(stays, np.inf, np.where(lands_on_second, landing_time, touchdown))
    return ContactSchedule(
        landing=_put_on(window, landing),
        liftoff=_put_on(window, liftoff),
        touchdown=_put_on(window, touchdown),
        disagreement=disagreement.astype(np.int8),
    )


def _put_on(end: float, times: Array) -> Array:
    return np.where(np.abs(times - end) < SAME_TIME, end, times)
