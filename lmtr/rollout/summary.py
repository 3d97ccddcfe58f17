"""Aggregate performance over many motions, with confidence intervals (Sec. 5.2, Fig. 4c)."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import astuple, dataclass

import numpy as np
from scipy.stats import binomtest

from lmtr.arrays import Array, Indices
from lmtr.errors import DataError
from lmtr.robot.model import RobotModel
from lmtr.rollout.balance import mean_residuals
from lmtr.rollout.contacts import Disagreement
from lmtr.rollout.record import Ending, Rollout
from lmtr.rollout.settings import Criteria
from lmtr.rollout.tally import NAMES, RATES, Tally
from lmtr.streams import Purpose, stream
from lmtr.trajectory.motion import Motion

CONFIDENCE = 0.95
"""Coverage of the confidence intervals."""

UPPER = 0.95
"""The percentile of residuals that stands for their upper end, as a share."""

RESAMPLES = 2000
"""Bootstrap draws; the ends of an interval then repeat to a few hundredths of its width."""


@dataclass(frozen=True)
class Estimate:
    """A value over all motions, and its bootstrap percentile interval over motions.

    Motions are drawn, not feet or samples: those of one motion depend on each other. NaN where
    nothing was there to be judged.
    """

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Performance:
    """Obstacle avoidance, kinematic violation and progress of a set of motions.

    Attributes:
        motions: Motions judged.
        obstacles_crossed: Obstacle lines crossed by all of them.
        close_share: Share of (line, foot) pairs with the closest foothold nearer than
            ``Criteria.clearance``.
        mean_violation: Mean forward violation of contacting feet (m).
        large_violation_share: Share of contacting feet beyond ``Criteria.large_violation``.
        friction_share: Share of contacting feet whose planned force leaves the friction pyramid.
        mean_friction_excess: Mean over contacting feet of how far outside it is (weights).
        pull_share: Share of contacting feet whose planned force pulls at the ground.
        linear_residual: Mean acceleration of the base that its forces leave unexplained (m/s²).
        angular_residual: Mean angular acceleration left unexplained (rad/s²).
        mean_velocity_jump: Mean change of the base's velocity at replanning (m/s).
        mean_foot_jump: Mean distance between a foot so far and in the new plan (m).
        distance: Mean way along the world's x axis (m).
        speed: All way over all time (m/s).
        fall_share: Share of motions that diverged, with the exact binomial interval: where none
            did, a bootstrap would claim to be certain.
    """

    motions: int
    obstacles_crossed: int
    close_share: Estimate
    mean_violation: Estimate
    large_violation_share: Estimate
    friction_share: Estimate
    mean_friction_excess: Estimate
    pull_share: Estimate
    linear_residual: Estimate
    angular_residual: Estimate
    mean_velocity_jump: Estimate
    mean_foot_jump: Estimate
    distance: Estimate
    speed: Estimate
    fall_share: Estimate


@dataclass(frozen=True)
class ReplannerSummary:
    """Aggregate performance of one replanner, and how continuous its rollouts are.

    Attributes:
        replanner: Name of the replanner.
        performance: Over all rollouts; a diverged one counts up to where it diverged.
        diverged: Rollouts that diverged; compare performance only with this beside it.
        reasons: How many diverged for which reason.
        linear_residual_p95: 95th percentile of the acceleration left unexplained (m/s²).
        angular_residual_p95: Likewise of the angular acceleration (rad/s²).
        velocity_jump: Median change of the base's velocity at replanning (m/s).
        foot_jump: Median distance between a foot so far and in the new plan (m).
        disagreement_share: Share of (replanning, foot) pairs that disagree about the contact.
        disagreements: How many of them are of which kind.
        plan_seconds: Median planning time of one rollout and cycle (s).
    """

    replanner: str
    performance: Performance
    diverged: int
    reasons: dict[Ending, int]
    linear_residual_p95: float
    angular_residual_p95: float
    velocity_jump: float
    foot_jump: float
    disagreement_share: float
    disagreements: dict[Disagreement, int]
    plan_seconds: float


def summarise(
    rollouts: Sequence[Rollout],
    robot: RobotModel,
    criteria: Criteria | None = None,
    seed: int = 0,
    tallies: Sequence[Tally] | None = None,
) -> ReplannerSummary:
    """Summarise the rollouts of one replanner.

    Args:
        rollouts: All of them, diverged ones too.
        robot: Robot whose neutral stance they are judged by.
        criteria: Thresholds; those of the paper's evaluation unless given.
        seed: Seed of the bootstrap draws.
        tallies: Those of the rollouts, if they have been made already.

    Raises:
        DataError: There are no rollouts, or those of several replanners.
    """
    names = sorted({rollout.replanner for rollout in rollouts})
    if len(names) != 1:
        raise DataError(
            f"summary: takes the rollouts of one replanner, got those of {names}; "
            "summarise each replanner by itself"
        )
    if tallies is None:
        tallies = [Tally.of_rollout(each, robot, criteria or Criteria()) for each in rollouts]
    reasons = Counter(rollout.ending for rollout in rollouts if rollout.diverged)
    kinds = np.concatenate([rollout.disagreements.reshape(-1) for rollout in rollouts])
    found = Counter(Disagreement(kind) for kind in kinds[kinds != Disagreement.NONE].tolist())
    linear, angular = residual_percentiles([mean_residuals(r.motion, robot) for r in rollouts])
    return ReplannerSummary(
        replanner=names[0],
        performance=pooled(tallies, seed),
        diverged=reasons.total(),
        reasons=dict(reasons),
        linear_residual_p95=linear,
        angular_residual_p95=angular,
        velocity_jump=_median([rollout.velocity_jump for rollout in rollouts]),
        foot_jump=_median([rollout.foot_jump.reshape(-1) for rollout in rollouts]),
        disagreement_share=found.total() / kinds.size if kinds.size else float("nan"),
        disagreements=dict(found),
        plan_seconds=_median([rollout.plan_seconds for rollout in rollouts]),
    )


def performance(
    motions: Sequence[tuple[Motion, Array]],
    robot: RobotModel,
    criteria: Criteria | None = None,
    seed: int = 0,
) -> Performance:
    """Judge motions, each beside its obstacle lines (n, 3): rollouts or expert solutions.

    Raises:
        DataError: There are no motions.
    """
    if not motions:
        raise DataError("summary: takes at least one motion, got none; run some rollouts first")
    criteria = criteria or Criteria()
    return pooled([Tally.of(motion, lines, robot, criteria) for motion, lines in motions], seed)


def pooled(tallies: Sequence[Tally], seed: int = 0) -> Performance:
    """Performance of the motions that tallies were made of, at least one."""
    columns = np.array([astuple(tally) for tally in tallies])
    draws = stream(seed, Purpose.BOOTSTRAP).integers(len(tallies), size=(RESAMPLES, len(tallies)))

    def rate(name: str) -> Estimate:
        part, whole = (columns[:, NAMES.index(each)] for each in RATES[name])
        return _estimate(part, whole, draws)

    falls = int(sum(tally.falls for tally in tallies))
    return Performance(
        motions=len(tallies),
        obstacles_crossed=int(sum(tally.crossed for tally in tallies)),
        fall_share=_share(falls, len(tallies)),
        **{name: rate(name) for name in RATES if name != "fall_share"},
    )


def residual_percentiles(residuals: Sequence[tuple[Array, Array]]) -> tuple[float, float]:
    """95th percentiles of linear and angular residuals over the samples of all motions.

    Args:
        residuals: Both of each motion, as :func:`~lmtr.rollout.balance.mean_residuals` has them.

    Returns:
        m/s² and rad/s²; NaN over no samples.
    """
    linear, angular = (np.concatenate(parts) for parts in zip(*residuals, strict=True))
    return _percentile(linear), _percentile(angular)


def _percentile(values: Array) -> float:
    return float(np.quantile(values, UPPER)) if values.size else float("nan")


def _share(count: int, of: int) -> Estimate:
    """A share with its interval of Clopper and Pearson."""
    found = binomtest(count, of).proportion_ci(CONFIDENCE)
    return Estimate(count / of, float(found.low), float(found.high))


def _estimate(part: Array, whole: Array, draws: Indices) -> Estimate:
    """Σ part / Σ whole over motions, resampled by ``draws`` (R, n)."""
    if whole.sum() <= 0.0:
        return Estimate(float("nan"), float("nan"), float("nan"))
    drawn_part, drawn_whole = part[draws].sum(axis=1), whole[draws].sum(axis=1)
    judged = drawn_whole > 0.0  # a draw of motions that crossed nothing says nothing
    tail = (1.0 - CONFIDENCE) / 2.0
    low, high = np.quantile(drawn_part[judged] / drawn_whole[judged], [tail, 1.0 - tail])
    return Estimate(float(part.sum() / whole.sum()), float(low), float(high))


def _median(values: list[Array]) -> float:
    pooled = np.concatenate(values)
    return float(np.median(pooled)) if pooled.size else float("nan")
