"""The measures of a rollout that tables and figures show, with their units."""

from dataclasses import dataclass

from lmtr.rollout.summary import Estimate
from pipelines.results.blocks import Measure
from pipelines.results.groups import Group


@dataclass(frozen=True)
class Measured:
    """One rate of :data:`lmtr.rollout.tally.RATES` as readers see it.

    Attributes:
        rate: Its name.
        name: Column name.
        title: Title of a panel.
        unit: Unit that it is shown in.
        scale: From SI to this unit.
    """

    rate: str
    name: str
    title: str
    unit: str
    scale: float

    @property
    def label(self) -> str:
        """Label of an axis."""
        return f"{self.name} ({self.unit})"

    def measure(self, group: Group) -> Measure:
        """The rate of a group with its interval."""
        found: Estimate = group.rate(self.rate)
        return Measure.of(found, self.scale)

    def by_seed(self, group: Group) -> list[float]:
        """The rate of each training seed."""
        return [self.scale * value for value in group.by_seed(self.rate)]


MEASURES = {
    each.rate: each
    for each in (
        Measured("close_share", "close footholds", "Obstacle avoidance", "%", 100.0),
        Measured("mean_violation", "mean violation", "Kinematic violation", "mm", 1e3),
        Measured("large_violation_share", "samples over 5 cm", "Severe violation", "%", 100.0),
        Measured("distance", "distance", "Distance covered", "m", 1.0),
        Measured("mean_velocity_jump", "velocity jump", "Jump of the base", "m/s", 1.0),
        Measured("mean_foot_jump", "foot jump", "Jump of the feet", "mm", 1e3),
        Measured("linear_residual", "linear residual", "Linear balance", "m/s²", 1.0),
        Measured("angular_residual", "angular residual", "Angular balance", "rad/s²", 1.0),
        Measured("friction_share", "outside friction", "Friction", "%", 100.0),
        Measured("mean_friction_excess", "friction excess", "Friction", "weights", 1.0),
        Measured("pull_share", "pulling feet", "Pull", "%", 100.0),
    )
}
"""By name of the rate, in the order of tables."""

PHYSICS = (
    "linear_residual",
    "angular_residual",
    "friction_share",
    "mean_friction_excess",
    "pull_share",
)
"""Rates that tell whether planned forces and motion agree; the others tell how it walks."""
