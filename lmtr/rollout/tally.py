"""Sums over motions: every rate of Sec. 5.2 is a ratio of two of them.

Sums of single rollouts are all that comparisons need: they can be pooled and resampled without the
motions that they were made from.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Self

import numpy as np

from lmtr.arrays import Array
from lmtr.robot.model import RobotModel
from lmtr.rollout.balance import friction_excess, mean_residuals, pull
from lmtr.rollout.metrics import forward_violation, obstacle_clearances
from lmtr.rollout.record import Rollout
from lmtr.rollout.settings import Criteria
from lmtr.trajectory.motion import Motion


@dataclass(frozen=True)
class Tally:
    """Sums over one motion.

    Attributes:
        motions: 1.
        falls: 1 if it diverged, else 0.
        crossed: Obstacle lines crossed.
        steps: Pairs of a crossed line and a foot.
        close_steps: Those whose closest foothold is closer than ``Criteria.clearance``.
        contacts: Pairs of a sample and a foot in contact.
        violation: Sum over them of the forward violation (m).
        large_violations: Those beyond ``Criteria.large_violation``.
        friction_violations: Those whose planned force leaves the friction pyramid, or pulls, by
            more than ``Criteria.friction_excess``.
        friction_excess: Sum over all of them of how far it is outside (weights of the robot).
        pulls: Those whose planned force pulls at the ground by more than that.
        balances: Samples at which the dynamics were judged.
        linear_residual: Sum over them of the acceleration left unexplained (m/s²).
        angular_residual: Sum over them of the angular acceleration left unexplained (rad/s²).
        replannings: Replanning cycles; none of an expert solution.
        velocity_jump: Sum over them of the change of the base's velocity (m/s).
        foot_replannings: Pairs of a replanning and a foot.
        foot_jump: Sum over them of the distance between foot so far and in the new plan (m).
        distance: Way along the world's x axis (m).
        duration: Time covered (s).
    """

    motions: float
    falls: float
    crossed: float
    steps: float
    close_steps: float
    contacts: float
    violation: float
    large_violations: float
    friction_violations: float
    friction_excess: float
    pulls: float
    balances: float
    linear_residual: float
    angular_residual: float
    replannings: float
    velocity_jump: float
    foot_replannings: float
    foot_jump: float
    distance: float
    duration: float

    @classmethod
    def of(
        cls,
        motion: Motion,
        obstacles_W: Array,
        robot: RobotModel,
        criteria: Criteria,
        rollout: Rollout | None = None,
    ) -> Self:
        """Judge one motion; with the ``rollout`` that it comes from, also its replannings."""
        clearances = obstacle_clearances(motion, obstacles_W)
        violation = forward_violation(motion, robot, criteria.forward_limit)
        excess, pulled = friction_excess(motion, robot), pull(motion, robot)
        linear, angular = mean_residuals(motion, robot)
        base_jumps = np.zeros(0) if rollout is None else rollout.velocity_jump
        foot_jumps = np.zeros(0) if rollout is None else rollout.foot_jump
        return cls(
            motions=1.0,
            falls=float(rollout is not None and rollout.diverged),
            crossed=float(len(clearances)),
            steps=float(clearances.size),
            close_steps=float((clearances < criteria.clearance).sum()),
            contacts=float(motion.contact.sum()),
            violation=float(np.nansum(violation)),
            large_violations=float((violation > criteria.large_violation).sum()),
            friction_violations=float((excess > criteria.friction_excess).sum()),
            friction_excess=float(np.nansum(excess)),
            pulls=float((pulled > criteria.friction_excess).sum()),
            balances=float(len(linear)),
            linear_residual=float(linear.sum()),
            angular_residual=float(angular.sum()),
            replannings=float(base_jumps.size),
            velocity_jump=float(base_jumps.sum()),
            foot_replannings=float(foot_jumps.size),
            foot_jump=float(foot_jumps.sum()),
            distance=float(motion.base_position_W[-1, 0] - motion.base_position_W[0, 0]),
            duration=float(motion.times[-1] - motion.times[0]),
        )

    @classmethod
    def of_rollout(cls, rollout: Rollout, robot: RobotModel, criteria: Criteria) -> Self:
        """Judge one rollout, a diverged one up to where it diverged."""
        return cls.of(rollout.motion, rollout.obstacles_W, robot, criteria, rollout)

    @classmethod
    def joined(cls, parts: Sequence[Self], fell: bool) -> Self:
        """Of one motion that was judged in parts, and whether it fell on one of them."""
        sums = {name: float(sum(getattr(part, name) for part in parts)) for name in NAMES}
        return cls(**{**sums, "motions": 1.0, "falls": float(fell)})

    @classmethod
    def from_dict(cls, sums: Mapping[str, float]) -> Self:
        """The inverse of :meth:`as_dict`; NaN for sums that were not made when it was."""
        return cls(**{name: float(sums.get(name, float("nan"))) for name in NAMES})

    def as_dict(self) -> dict[str, float]:
        """All sums by name."""
        return asdict(self)


NAMES = tuple(field.name for field in fields(Tally))
"""Names of the sums, in order."""

RATES: dict[str, tuple[str, str]] = {
    "close_share": ("close_steps", "steps"),
    "mean_violation": ("violation", "contacts"),
    "large_violation_share": ("large_violations", "contacts"),
    "friction_share": ("friction_violations", "contacts"),
    "mean_friction_excess": ("friction_excess", "contacts"),
    "pull_share": ("pulls", "contacts"),
    "linear_residual": ("linear_residual", "balances"),
    "angular_residual": ("angular_residual", "balances"),
    "mean_velocity_jump": ("velocity_jump", "replannings"),
    "mean_foot_jump": ("foot_jump", "foot_replannings"),
    "distance": ("distance", "motions"),
    "speed": ("distance", "duration"),
    "fall_share": ("falls", "motions"),
}
"""Each rate as the two sums whose ratio it is."""
