"""Settings of the expert's scope: duration, swings per leg and the timing of the first guess."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from lmtr.trajectory.trajectory import BASE_STEP

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class Scope(BaseModel):
    """The long scope s̄ = (T̄, N̄_p) and the nominal walk that fills it.

    Attributes:
        duration: T̄, a multiple of the base's knot spacing (s).
        n_swings: N̄_p, swings per leg.
        swing_share: Nominal duration of a swing as a share of T̄/(N̄_p + ½).
        first_liftoff: Nominal time of the first lift-off, and of rest at the end (s).
        clearance: Height of the middle of a swing (m).
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    duration: Positive = 7.5
    n_swings: Annotated[int, Field(ge=1)] = 6
    swing_share: Positive = 0.28
    first_liftoff: Positive = 0.2
    clearance: Positive = 0.08

    @property
    def n_nodes(self) -> int:
        """Base nodes, one every 0.1 s and one at each end."""
        return round(self.duration / BASE_STEP) + 1

    @property
    def n_stances(self) -> int:
        """Stances per leg."""
        return self.n_swings + 1

    @property
    def nominal_swing(self) -> float:
        """Nominal duration of a swing (s)."""
        return self.swing_share * self.duration / (self.n_swings + 0.5)

    @property
    def nominal_cycle(self) -> float:
        """Nominal time between two lift-offs of one foot (s)."""
        return (self.duration - 2.0 * self.first_liftoff - self.nominal_swing) / (
            self.n_swings - 1 + 0.75
        )
