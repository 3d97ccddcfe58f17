"""Which solutions enter a data set: converged, physical, and not needlessly dear (Sec. 4.2).

A verdict on one solution depends on that solution and the thresholds alone, so it does not matter
in which order or company solutions are judged.
"""

from dataclasses import dataclass

import numpy as np

from lmtr.errors import DataError
from lmtr.quality.cost_model import DEFAULT_COST_MODEL, CostModel, task_features
from lmtr.quality.measure import Violations
from lmtr.quality.status import Status
from lmtr.robot.model import RobotModel
from lmtr.settings import NonNegative, Settings
from lmtr.task.task import Task

_NOT_CONVERGED = "not_converged"

_SENTENCES = {
    "linear_residual": "The forces do not explain the base's acceleration between the nodes.",
    "angular_residual": "The moments do not explain the base's rotation between the nodes.",
    "drift": "Following the planned forces without feedback leads away from the planned motion.",
    "stance_range_of_motion": "A standing foot leaves its range of motion.",
    "swing_range_of_motion": "A swinging foot leaves its range of motion.",
    "friction": "A foot pushes sideways more than friction holds.",
    "pull": "A foot pulls at the ground.",
    "contact_change_force": "A foot pushes at the instant of touch-down or lift-off.",
    "force_peak": "One foot carries more than the robot's legs can.",
    "slip": "A foot moves while it stands.",
    "off_ground": "A standing foot is not on the ground.",
    "below_ground": "A swinging foot goes below the ground.",
    "flight": "The robot jumps: at some time no foot is on the ground.",
    "phase_too_short": "A stance or swing is shorter than legs can follow.",
    "height": "The base crouches or rises too far.",
    "tilt": "The base rolls or pitches too far.",
    "obstacle": "A foothold lies on an obstacle line.",
    "cost": "The solution is much dearer than others of such tasks: a poor local optimum.",
}
REASONS = (*_SENTENCES, _NOT_CONVERGED)
"""Stable names of the reasons for which solutions are refused."""


class QualityThresholds(Settings):
    """What a solution may show and still enter a data set.

    The defaults catch what is wrong, not what is unusual. In brackets: median, and the worst of
    240 converged solutions (ANYmal, default settings, 0 to 4 lines), none of which they refuse.

    Attributes:
        linear_residual: Largest unexplained acceleration (m/s²) [0.5, 1.4]; the dynamics hold at
            the nodes only, and a controller makes up for a fifth of gravity in between.
        angular_residual: Largest unexplained angular acceleration (rad/s²) [1.4, 6.5].
        drift: Median drift over 0.8 s of open-loop forces (m) [0.009, 0.013].
        stance_overshoot: Largest overshoot of stance feet (m) [0.010, 0.013]. The forward box of
            ±0.16 m and this stay within the ±0.2 m that replanners are judged by (Sec. 5.2).
        swing_overshoot: Largest overshoot of swing feet (m) [0.014, 0.023]; they bear no load.
        friction_excess: Largest excess over the friction pyramid (weights) [0, 0].
        pull: Largest pulling force (weights) [0, 0].
        contact_change_force: Largest force at a contact change (weights) [0, 0]; τ has no place
            for any.
        force_peak: Largest force of one foot (weights) [0.9, 1.3]; a robot that stands on one
            foot needs one weight, a robot that lands from a jump several.
        stance_slip: Largest slip of a standing foot (m) [0, 0].
        stance_height: Largest distance of a standing foot to the ground (m) [0, 0].
        swing_depth: Deepest swing below the ground (m) [0, 0].
        flight_time: Longest time in all without contact (s) [0, 0]; two samples are let pass.
        phase_shortest: Shortest stance or swing (s) [0.20, 0.20].
        height_deviation: Largest departure of the base from nominal height (m) [0.05, 0.085].
        tilt: Largest roll or pitch (rad) [0.12, 0.25].
        obstacle_clearance: Least distance of a foothold to a line (m) [0.19, 0.065]: what counts
            as a close step of a replanner is nothing for it to learn.
        judge_cost: Whether the cost is judged; it never is where ``cost_model`` does not apply,
            that is, for another robot, scope, or weights of the expert's costs.
        cost_excess: Largest cost above the expected one, as a share of that [0, 0.32]; 0.1 would
            keep the better nine tenths.
        cost_model: The cost expected of a task.
    """

    linear_residual: NonNegative = 2.0
    angular_residual: NonNegative = 10.0
    drift: NonNegative = 0.03
    stance_overshoot: NonNegative = 0.03
    swing_overshoot: NonNegative = 0.06
    friction_excess: NonNegative = 0.01
    pull: NonNegative = 0.01
    contact_change_force: NonNegative = 1e-6
    force_peak: NonNegative = 1.5
    stance_slip: NonNegative = 1e-3
    stance_height: NonNegative = 1e-3
    swing_depth: NonNegative = 0.01
    flight_time: NonNegative = 0.01
    phase_shortest: NonNegative = 0.15
    height_deviation: NonNegative = 0.15
    tilt: NonNegative = 0.5
    obstacle_clearance: NonNegative = 0.05
    judge_cost: bool = True
    cost_excess: NonNegative = 0.4
    cost_model: CostModel = DEFAULT_COST_MODEL


@dataclass(frozen=True)
class Verdict:
    """Whether a solution enters the data set, and every reason why not."""

    accepted: bool
    reasons: tuple[str, ...]


def expected_cost(
    task: Task, robot: RobotModel, cost_key: str, thresholds: QualityThresholds
) -> float | None:
    """The cost to be expected of a task; none if nothing is known of such costs.

    Args:
        task: The task.
        robot: The robot that solves it.
        cost_key: Digest of the scope and cost weights that it is solved with.
        thresholds: Whether the cost is judged, and by which model.
    """
    model = thresholds.cost_model
    applies = model.robot == robot.name and model.cost_key == cost_key
    if not thresholds.judge_cost or not applies:
        return None
    return float(model.predict(task_features(task, robot)))


def judge(
    status: str,
    cost: float,
    expected_cost: float | None,
    violations: Violations,
    thresholds: QualityThresholds,
) -> Verdict:
    """Judge one solution.

    Args:
        status: Outcome of the solve, one of :class:`~lmtr.quality.status.Status`.
        cost: Its cost.
        expected_cost: The cost to be expected of its task; none leaves the cost unjudged.
        violations: Its measured violations.
        thresholds: What it may show.
    """
    reasons = [] if status == Status.CONVERGED else [f"{_NOT_CONVERGED}:{status}"]
    reasons += [reason for reason, broken in _broken(violations, thresholds).items() if broken]
    too_dear = expected_cost is not None and cost > expected_cost * (1.0 + thresholds.cost_excess)
    if too_dear or not np.isfinite(cost):
        reasons.append("cost")
    return Verdict(not reasons, tuple(reasons))


def describe(reason: str) -> str:
    """A sentence for a reason of a verdict.

    Raises:
        DataError: No verdict gives this reason.
    """
    kind, _, status = reason.partition(":")
    if kind == _NOT_CONVERGED and status:
        return f"The optimizer stopped without a solution: {status.replace('_', ' ')}."
    if reason not in _SENTENCES:
        raise DataError(f"reason {reason!r} is unknown; verdicts give {', '.join(REASONS)}")
    return _SENTENCES[reason]


def _broken(found: Violations, limits: QualityThresholds) -> dict[str, bool]:
    """Which rules a solution breaks, by reason; what is not a number breaks its rule."""
    at_most = {
        "linear_residual": (found.linear_residual_peak, limits.linear_residual),
        "angular_residual": (found.angular_residual_peak, limits.angular_residual),
        "drift": (found.drift, limits.drift),
        "stance_range_of_motion": (found.stance_overshoot, limits.stance_overshoot),
        "swing_range_of_motion": (found.swing_overshoot, limits.swing_overshoot),
        "friction": (found.friction_excess, limits.friction_excess),
        "pull": (found.pull, limits.pull),
        "contact_change_force": (found.contact_change_force, limits.contact_change_force),
        "force_peak": (found.force_peak, limits.force_peak),
        "slip": (found.stance_slip, limits.stance_slip),
        "off_ground": (found.stance_height, limits.stance_height),
        "below_ground": (found.swing_depth, limits.swing_depth),
        "flight": (found.flight_time, limits.flight_time),
        "height": (found.height_deviation, limits.height_deviation),
        "tilt": (found.tilt, limits.tilt),
    }
    shortest = min(found.stance_shortest, found.swing_shortest)
    at_least = {
        "phase_too_short": (shortest, limits.phase_shortest),
        "obstacle": (min(found.closest_footholds, default=np.inf), limits.obstacle_clearance),
    }
    broken = {reason: not value <= limit for reason, (value, limit) in at_most.items()}
    return broken | {reason: not value >= limit for reason, (value, limit) in at_least.items()}
