"""One trial in a worker process: its rollouts, and what the lake keeps of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from lmtr.models.trained import TrainedModel
from lmtr.robot.model import RobotModel
from lmtr.rollout.courses import random_courses
from lmtr.rollout.metrics import forward_violation, obstacle_clearances
from lmtr.rollout.record import Rollout
from lmtr.rollout.settings import Criteria
from lmtr.rollout.starts import draw_starts
from lmtr.rollout.summary import ReplannerSummary, summarise
from lmtr.rollout.tally import Tally
from lmtr.rollout.testbed import run_rollouts
from pipelines import records
from pipelines.learning_data import LearningData
from pipelines.records import Row
from pipelines.sections import EvaluationSection
from pipelines.trials import Trial, replanner_of


@dataclass(frozen=True)
class Tried:
    """What came out of a trial.

    Attributes:
        rows: Columns of table ``rollouts`` of every rollout, diverged ones too, without those that
            name the trial.
        summary: Aggregate performance.
        nbytes: Memory that planning needs (bytes).
        planner: The replanner's own description, plain JSON types.
        shown: The longest rollout, for a picture; none of a tuning.
    """

    rows: list[Row]
    summary: ReplannerSummary
    nbytes: int
    planner: dict[str, Any]
    shown: Rollout | None


class RolloutWorker:
    """Rolls replanners out in a worker process, which holds data and models once."""

    def __init__(
        self,
        data: LearningData,
        models: dict[str, TrainedModel],
        robot: RobotModel,
        section: EvaluationSection,
    ) -> None:
        self._data = data
        self._models = models
        self._robot = robot
        self._section = section
        self._courses = random_courses(section.rollout, section.seed, range(section.rollouts))
        self._starts = draw_starts(data.validation.tau, self._courses)

    def __call__(self, trial: Trial) -> Tried:
        """All rollouts of one replanner, and their summary."""
        section, robot = self._section, self._robot
        model = None if trial.model_id is None else self._models[trial.model_id]
        replanner = replanner_of(trial, model, self._data.training, robot, section)
        rollouts = run_rollouts(replanner, self._courses, self._starts, section.rollout, robot)
        tallies = [Tally.of_rollout(each, robot, section.criteria) for each in rollouts]
        reported = trial.purpose == "report"
        kept = set(_kept(rollouts, section.keep_motions))
        rows = [
            {
                **_outcome(rollout, tally),
                **(_distributions(rollout, robot, section.criteria) if reported else UNKEPT),
                **(records.motion_columns(rollout.motion) if number in kept else NO_MOTION),
            }
            for number, (rollout, tally) in enumerate(zip(rollouts, tallies, strict=True))
        ]
        return Tried(
            rows,
            summarise(rollouts, robot, section.criteria, tallies=tallies),
            replanner.nbytes,
            replanner.describe(),
            max(rollouts, key=lambda each: each.end_time) if reported else None,
        )


def _kept(rollouts: Sequence[Rollout], count: int) -> list[int]:
    """The rollouts whose motion is kept: those that reached their end come first."""
    order = sorted(range(len(rollouts)), key=lambda number: rollouts[number].diverged)
    return order[:count]


def _outcome(rollout: Rollout, tally: Tally) -> Row:
    """How a rollout went."""
    return {
        "index": rollout.index,
        "seed": rollout.seed,
        "outcome": "diverged" if rollout.diverged else "completed",
        "reason": str(rollout.ending) if rollout.diverged else None,
        "duration_s": rollout.end_time,
        "distance_m": tally.distance,
        "metrics": list(tally.as_dict().items()),
    }


def _distributions(rollout: Rollout, robot: RobotModel, criteria: Criteria) -> Row:
    """The course, and what figures show the distribution of."""
    motion = rollout.motion
    violation = forward_violation(motion, robot, criteria.forward_limit)
    return {
        "obstacles": rollout.obstacles_W.ravel().tolist(),
        "clearances": obstacle_clearances(motion, rollout.obstacles_W).ravel().tolist(),
        "violations": violation[motion.contact].tolist(),
        "velocity_jumps": rollout.velocity_jump.tolist(),
        "foot_jumps": rollout.foot_jump.ravel().tolist(),
        "disagreements": rollout.disagreements.ravel().tolist(),
        "plan_seconds": rollout.plan_seconds.tolist(),
    }


UNKEPT: Row = {
    name: []
    for name in (
        "obstacles",
        "clearances",
        "violations",
        "velocity_jumps",
        "foot_jumps",
        "disagreements",
        "plan_seconds",
    )
}
"""The same columns of rollouts that only chose weights; their seed and index tell the course."""

NO_MOTION: Row = {name: [] for name in records.ALL_MOTION_COLUMNS}
"""Columns of a motion that is not kept."""
