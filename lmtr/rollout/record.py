"""What is kept of one rollout."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from lmtr.arrays import Array
from lmtr.trajectory.motion import Motion


class Ending(StrEnum):
    """How a rollout ended: completed, or the first limit that its next window would have left."""

    COMPLETED = "completed"
    NOT_FINITE = "not_finite"
    BASE_HEIGHT = "base_height"
    TILT = "tilt"
    SPEED = "speed"
    FOOT_OFFSET = "foot_offset"

    def describe(self) -> str:
        """A sentence for readers; the value itself is what is stored."""
        return _SENTENCES[self]


_SENTENCES = {
    Ending.COMPLETED: "The robot walked for the whole duration.",
    Ending.NOT_FINITE: "A plan held numbers that are not finite, or absurdly large.",
    Ending.BASE_HEIGHT: "The base left the plausible heights.",
    Ending.TILT: "The base rolled or pitched too far.",
    Ending.SPEED: "The base moved faster than any walking robot.",
    Ending.FOOT_OFFSET: "A foot went further from its neutral position than a leg reaches.",
}


@dataclass(frozen=True)
class Rollout:
    """One rollout of C replanning cycles that were carried out.

    Attributes:
        replanner: Name of the replanner.
        seed: Seed of the set of courses.
        index: Which course of the set.
        motion: The accumulated motion, sampled every 0.1 s; of a diverged rollout up to the
            replanning time at which it diverged.
        obstacles_W: All lines of the course, (n, 3) in m and rad.
        ending: Completed, or why it diverged.
        velocity_jump: Change of the base's velocity at each replanning, (C,) in m/s.
        foot_jump: Distance between the feet so far and in the new plan, (C, 4) in m.
        disagreements: :class:`~lmtr.rollout.contacts.Disagreement` of each foot, (C, 4).
        plan_seconds: Time of the batch's plan, divided by its rollouts, (C,) in s.
    """

    replanner: str
    seed: int
    index: int
    motion: Motion
    obstacles_W: Array
    ending: Ending
    velocity_jump: Array
    foot_jump: Array
    disagreements: NDArray[np.int8]
    plan_seconds: Array

    @property
    def diverged(self) -> bool:
        """Whether the rollout ended before its time."""
        return self.ending is not Ending.COMPLETED

    @property
    def end_time(self) -> float:
        """When the rollout ended (s)."""
        return float(self.motion.times[-1])
