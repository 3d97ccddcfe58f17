"""Windows of the contact changes around the nominal timing, and which samples can meet them."""

from dataclasses import dataclass

import numpy as np

from lmtr.arrays import Array
from lmtr.expert.initial_guess import contact_times
from lmtr.expert.settings import ExpertSettings
from lmtr.robot.model import N_FEET


@dataclass(frozen=True)
class Windows:
    """Nominal, earliest and latest contact changes by slot, (4, 2·N̄_p + 2) each in s.

    The first column is the start of the first stance, the last one the end of the last stance,
    both exact.
    """

    nominal: Array
    earliest: Array
    latest: Array

    def swings_met(self, slot: int, time: float) -> tuple[int, int]:
        """First swing that may not be over at ``time``, and first that cannot have begun."""
        over = int((self.latest[slot, 2::2] <= time).sum())
        begun = int((self.earliest[slot, 1:-1:2] < time).sum())
        return over, max(begun, over)

    def stances_met(self, slot: int, time: float) -> list[int]:
        """Stances during which a foot may push at ``time``; at its very ends the force is zero."""
        begin, end = self.earliest[slot, 0::2].copy(), self.latest[slot, 1::2].copy()
        begin[0], end[-1] = -np.inf, np.inf
        return [int(j) for j in np.flatnonzero((begin < time) & (time < end))]


def windows(settings: ExpertSettings) -> Windows:
    """Windows t_nominal ± W, cut so that first and last stances keep their shortest time (E10)."""
    scope, limits = settings.scope, settings.limits
    nominal = contact_times(scope, tuple(range(N_FEET)))
    margin = limits.stance[0]
    spread = np.full_like(nominal, limits.window)
    spread[:, [0, -1]] = 0.0
    earliest, latest = nominal - spread, nominal + spread
    inner = slice(1, -1)
    earliest[:, inner] = np.clip(earliest[:, inner], margin, scope.duration - margin)
    latest[:, inner] = np.clip(latest[:, inner], margin, scope.duration - margin)
    return Windows(nominal, earliest, latest)
