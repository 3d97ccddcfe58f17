"""Stage 4: roll out every replanner over the same random courses; log and keep what came out."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from lmtr.errors import ModelError
from lmtr.figures.motion_figure import motion_figure
from lmtr.models.trained import TrainedModel
from lmtr.robot.model import RobotModel
from lmtr.rollout.courses import random_courses
from lmtr.rollout.metrics import forward_violation, obstacle_clearances
from lmtr.rollout.record import Rollout
from lmtr.rollout.starts import draw_starts
from lmtr.rollout.summary import ReplannerSummary, summarise
from lmtr.rollout.testbed import run_rollouts
from pipelines import records
from pipelines.config import Configuration
from pipelines.datasets import configuration_of
from pipelines.learning_data import LearningData
from pipelines.progress import bar, say
from pipelines.provenance import code_version
from pipelines.registry import load, models
from pipelines.sections import EvaluationSection
from pipelines.trials import CHOICES, Trial, replanner_of, trials
from pipelines.turns import beside_others
from pipelines.workspace import Workspace
from services.lake.tables import Lake

EXPERIMENT = "evaluation"


@dataclass(frozen=True)
class Tried:
    """What came out of a trial.

    Attributes:
        rollouts: All of them, diverged ones too.
        summary: Their aggregate performance.
        nbytes: Memory that planning needs (bytes).
        planner: The replanner's own description, plain JSON types.
    """

    rollouts: list[Rollout]
    summary: ReplannerSummary
    nbytes: int
    planner: dict[str, Any]


class EvaluateWorker:
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
        model = None if trial.model_id is None else self._models[trial.model_id]
        replanner = replanner_of(trial, model, self._data.training, self._robot, self._section)
        rollouts = run_rollouts(
            replanner, self._courses, self._starts, self._section.rollout, self._robot
        )
        return Tried(
            rollouts,
            summarise(rollouts, self._robot, self._section.criteria),
            replanner.nbytes,
            replanner.describe(),
        )


def evaluate(
    config: Configuration,
    workspace: Workspace,
    data: LearningData,
    model_ids: Sequence[str] | None = None,
) -> list[str]:
    """Roll out what has not been; returns the ids of all evaluations that are asked for.

    Args:
        config: Rollouts, weights, testbed.
        workspace: The home.
        data: The data set; its validation split gives the starts.
        model_ids: Models to evaluate; None for all of the data set.
    """
    known = models(workspace, data.dataset_id, data.segmentation_id, model_ids)
    wanted = trials(config, data, known)
    done = _evaluated(workspace.lake)
    missing = [trial for trial in wanted if trial.evaluation_id not in done]
    if missing:
        with beside_others(workspace.home, "evaluate", shared=True):
            _evaluate_missing(config, workspace, data, missing)
    else:
        say(f"evaluate: all {len(wanted)} replanners are evaluated already")
    return [trial.evaluation_id for trial in wanted]


def _evaluated(lake: Lake) -> set[str]:
    """Evaluations that are whole in the lake; a repair may have taken out the rollouts of one."""
    done = set(lake.values("evaluations", "evaluation_id"))
    return done & set(lake.values("rollouts", "evaluation_id"))


def _evaluate_missing(
    config: Configuration, workspace: Workspace, data: LearningData, missing: list[Trial]
) -> None:
    robot = configuration_of(workspace, data.dataset_id).dataset.robot
    used = {trial.model_id for trial in missing if trial.model_id is not None}
    loaded = {model_id: load(workspace, model_id) for model_id in sorted(used)}
    experiment = workspace.tracker.experiment(EXPERIMENT)
    make_worker = functools.partial(EvaluateWorker, data, loaded, robot, config.evaluation)
    record = _Recorder(config.evaluation, workspace, experiment, data, robot)
    failed: list[str] = []
    with (
        workspace.cluster(len(missing)) as cluster,
        bar("Rolling out", len(missing)) as progress,
    ):
        for outcome in cluster.stream(make_worker, missing):
            if outcome.error is None:
                record(outcome.item, outcome.value)
                say(f"evaluate: {outcome.item.evaluation_id}: {_result(outcome.value)}")
            else:
                failed.append(f"{outcome.item.label} ({outcome.error})")
            progress.advance(note=outcome.item.label)
    if failed:
        raise ModelError(f"evaluate: failed for {'; '.join(failed)}; the others are kept")


def _result(tried: Tried) -> str:
    """The finding in a few words."""
    found = tried.summary.performance
    return (
        f"{100 * found.close_share.value:.1f} % close steps, "
        f"{1e3 * found.mean_violation.value:.2f} mm violation, {tried.summary.diverged} diverged"
    )


@dataclass(frozen=True)
class _Recorder:
    """Keeps what comes out of trials: in the tracker, and in the lake."""

    section: EvaluationSection
    workspace: Workspace
    experiment: str
    data: LearningData
    robot: RobotModel

    def __call__(self, trial: Trial, tried: Tried) -> None:
        """Log the run, then append its rollouts, and last the evaluation that makes them count."""
        metrics = {**records.summary_metrics(tried.summary), "nbytes": float(tried.nbytes)}
        lake = self.workspace.lake
        run_id = self._log(trial, tried, metrics)
        rows = [self._rollout_row(trial, rollout) for rollout in tried.rollouts]
        lake.append_rows("rollouts", rows, app_id=f"rollouts/{trial.evaluation_id}")
        row = {
            "evaluation_id": trial.evaluation_id,
            "dataset_id": self.data.dataset_id,
            "segmentation_id": self.data.segmentation_id,
            "replanner": trial.label,
            "model_id": trial.model_id,
            "weights": list(trial.weights.values),
            "planner": records.to_json(tried.planner),
            "settings": self.section.model_dump_json(exclude=CHOICES),
            "seed": self.section.seed,
            "summary": list(metrics.items()),
            "segments_version": self.data.version,
            "mlflow_run_id": run_id,
            "code_version": code_version(),
            "created_at": records.now(),
        }
        lake.append_rows("evaluations", [row], app_id=f"evaluations/{trial.evaluation_id}")

    def _log(self, trial: Trial, tried: Tried, metrics: dict[str, float]) -> str:
        """Log one run of the tracker; returns its id."""
        parameters = {
            "replanner": trial.label,
            "model_id": trial.model_id or "",
            "weight": trial.weights.model_dump(),
            "policy": trial.policy,
            **self.section.model_dump(mode="json", exclude=CHOICES),
            **self.data.provenance,
        }
        tags = {
            "evaluation_id": trial.evaluation_id,
            "code_version": code_version(),
            "stage": "evaluate",
        }
        with self.workspace.tracker.run(
            self.experiment, trial.evaluation_id, parameters, tags
        ) as run:
            run.metrics((key, value, 0) for key, value in metrics.items())
            longest = max(tried.rollouts, key=lambda rollout: rollout.end_time)
            if len(longest.motion.times) > 1:
                figure = motion_figure(longest.motion, longest.obstacles_W, trial.label)
                run.figure(figure, "rollout.png")
        return str(run.id)

    def _rollout_row(self, trial: Trial, rollout: Rollout) -> records.Row:
        motion, path = rollout.motion, rollout.motion.base_position_W[:, 0]
        violation = forward_violation(motion, self.robot, self.section.criteria.forward_limit)
        return {
            "rollout_id": f"{trial.evaluation_id}-{rollout.index:03d}",
            "evaluation_id": trial.evaluation_id,
            "dataset_id": self.data.dataset_id,
            "replanner": trial.label,
            "index": rollout.index,
            "seed": rollout.seed,
            "outcome": "diverged" if rollout.diverged else "completed",
            "reason": str(rollout.ending) if rollout.diverged else None,
            "duration_s": rollout.end_time,
            "distance_m": float(path[-1] - path[0]),
            "obstacles": rollout.obstacles_W.ravel().tolist(),
            "clearances": obstacle_clearances(motion, rollout.obstacles_W).ravel().tolist(),
            "violations": violation[motion.contact].tolist(),
            "velocity_jumps": rollout.velocity_jump.tolist(),
            "foot_jumps": rollout.foot_jump.ravel().tolist(),
            "disagreements": rollout.disagreements.ravel().tolist(),
            "plan_seconds": rollout.plan_seconds.tolist(),
            "created_at": records.now(),
            **records.motion_columns(motion),
        }
