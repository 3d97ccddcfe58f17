"""Which solutions enter a data set: converged, physical, and not needlessly dear (Sec. 4.2).

A verdict on one solution depends on that solution and the thresholds alone, so it does not matter
in which order or company solutions are judged.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lmtr.quality.cost_model import DEFAULT_COST_MODEL, CostModel, task_features
from lmtr.quality.limits import Limit
from lmtr.quality.measure import Violations
from lmtr.quality.rules import COST, NOT_CONVERGED, RULES, SATURATED, with_detail
from lmtr.quality.status import Status
from lmtr.robot.model import RobotModel
from lmtr.settings import NonNegative, Settings
from lmtr.task.task import Task


class QualityThresholds(Settings):
    """What a solution may show and still enter a data set.

    Some thresholds are laws or contracts, whatever the expert: feet neither slip, pull nor slide,
    nobody flies, phases are not shorter than legs can follow, feet stay clear of lines. The others
    are relative to the expert: they lie at the far ends of the distributions that it shows
    (``benchmarks/thresholds.py``, ``docs/quality.md``), of near or far goals, few or many lines,
    whichever reach further, so that hard tasks are not dropped for being hard. They keep out what
    is odd among its solutions, and each refuses less than one in a hundred; the cost refuses most.
    In brackets: median, and worst of 300 default tasks (ANYmal).

    Attributes:
        linear_residual: Largest unexplained acceleration (m/s²) [0.34, 0.73]; the dynamics hold in
            the mean around nodes, and a controller makes up for what is left in between.
        angular_residual: Largest unexplained angular acceleration (rad/s²) [0.95, 2.8].
        drift: Median drift over 0.8 s of open-loop forces (m) [0.0013, 0.0020].
        stance_overshoot: Largest overshoot of stance feet (m) [0, 0.0023]. The forward box of
            ±0.16 m and this stay within the ±0.2 m that replanners are judged by (Sec. 5.2).
        swing_overshoot: Largest overshoot of swing feet (m) [0.0042, 0.0074].
        friction_excess: Largest excess over the friction pyramid (weights) [0, 0].
        pull: Largest pulling force (weights) [0, 0].
        contact_change_force: Largest force at a contact change (weights) [0, 0]; τ has no place
            for any.
        force_peak: Largest force of one foot (weights) [0.95, 1.2]; a robot that stands on one
            foot needs one weight, a robot that lands from a jump several.
        stance_slip: Largest slip of a standing foot (m) [0, 0].
        stance_height: Largest distance of a standing foot to the ground (m) [0, 0].
        swing_depth: Deepest swing below the ground (m) [0, 0].
        flight_time: Longest time in all without support (s) [0, 0]; two samples are let pass.
        vertical_speed: Fastest rise or fall of the base (m/s) [0.28, 0.50]. A walk bobs by some
            centimetres; a jump of 5 cm begins at 1 m/s.
        vertical_energy_swing: Largest swing of the vertical motion's energy (m) [0.060, 0.10],
            likewise.
        landing_force: Largest force of a foot 0.1 s after its touch-down at the latest (weights)
            [0.16, 0.34].
        landing_rate: Fastest rise of that force (weights/s) [2.8, 5.6]; legs and force control
            have to follow it.
        landing_speed: Fastest sinking of the base at a touch-down (m/s) [0.10, 0.33].
        phase_shortest: Shortest stance or swing (s) [0.25, 0.25].
        height_deviation: Largest departure of the base from nominal height (m) [0.063, 0.089].
        tilt: Largest roll or pitch (rad) [0.12, 0.25].
        obstacle_clearance: Least distance of a foothold to a line (m) [0.18, 0.079]: twice what
            counts as a close step of a replanner, for what is learnt comes out a little off.
        tolerated_limits: Limits of the problem that a solution may lie on nevertheless.
        judge_cost: Whether the cost is judged; it never is where ``cost_model`` does not apply,
            that is, for other figures of the robot or other settings of the expert's problem.
        cost_excess: Largest cost above the expected one, as a share of that or of the typical
            cost, whichever is more [0, 0.2]. What is beyond is mostly a poor local optimum: dearer
            by a tenth and more than other solutions of the same task (``docs/quality.md``).
        cost_model: The cost expected of a task.
    """

    linear_residual: NonNegative = 0.75
    angular_residual: NonNegative = 2.6
    drift: NonNegative = 0.003
    stance_overshoot: NonNegative = 0.003
    swing_overshoot: NonNegative = 0.008
    friction_excess: NonNegative = 1e-3
    pull: NonNegative = 1e-3
    contact_change_force: NonNegative = 1e-6
    force_peak: NonNegative = 1.4
    stance_slip: NonNegative = 1e-3
    stance_height: NonNegative = 1e-3
    swing_depth: NonNegative = 0.01
    flight_time: NonNegative = 0.01
    vertical_speed: NonNegative = 0.48
    vertical_energy_swing: NonNegative = 0.11
    landing_force: NonNegative = 0.4
    landing_rate: NonNegative = 6.2
    landing_speed: NonNegative = 0.26
    phase_shortest: NonNegative = 0.15
    height_deviation: NonNegative = 0.087
    tilt: NonNegative = 0.23
    obstacle_clearance: NonNegative = 0.1
    tolerated_limits: tuple[Limit, ...] = ()
    judge_cost: bool = True
    cost_excess: NonNegative = 0.12
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
        cost_key: Digest of all that costs depend on, of the robot and expert that solve it.
        thresholds: Whether the cost is judged, and by which model.
    """
    model = thresholds.cost_model
    if not thresholds.judge_cost or model.cost_key != cost_key:
        return None
    return float(model.predict(task_features(task, robot)))


def judge(
    status: str,
    cost: float,
    expected_cost: float | None,
    violations: Violations,
    thresholds: QualityThresholds,
    saturated: Sequence[str] = (),
) -> Verdict:
    """Judge one solution.

    Args:
        status: Outcome of the solve, one of :class:`~lmtr.quality.status.Status`.
        cost: Its cost.
        expected_cost: The cost to be expected of its task; none leaves the cost unjudged.
        violations: Its measured violations.
        thresholds: What it may show.
        saturated: Names of the problem's limits that it lies on.
    """
    reasons = [] if status == Status.CONVERGED else [with_detail(NOT_CONVERGED, status)]
    broken = [
        rule.reason
        for rule in RULES
        if rule.broken(getattr(violations, rule.figure), getattr(thresholds, rule.threshold))
    ]
    reasons += dict.fromkeys(broken)  # a reason of several rules is given once
    reasons += [
        with_detail(SATURATED, limit)
        for limit in saturated
        if limit not in thresholds.tolerated_limits
    ]
    too_dear = expected_cost is not None and bool(
        thresholds.cost_model.excess(np.array(cost), np.array(expected_cost))
        > thresholds.cost_excess
    )
    if too_dear or not np.isfinite(cost):
        reasons.append(COST)
    return Verdict(not reasons, tuple(reasons))
