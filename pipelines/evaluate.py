"""Stage 4: roll out every replanner over the same random courses; log and keep what came out."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import pyarrow as pa

from lmtr.errors import LmtrError
from lmtr.figures.motion_figure import motion_figure
from lmtr.models.trained import TrainedModel
from lmtr.policies.distance import TaskWeights
from lmtr.replanners.build import build_replanner
from lmtr.robot.model import RobotModel
from lmtr.rollout.courses import random_courses
from lmtr.rollout.metrics import forward_violation, obstacle_clearances
from lmtr.rollout.record import Rollout
from lmtr.rollout.settings import Criteria
from lmtr.rollout.starts import draw_starts
from lmtr.rollout.summary import ReplannerSummary, summarise
from lmtr.rollout.testbed import run_rollouts
from pipelines import records
from pipelines.config import Configuration, EvaluationSection, fingerprint
from pipelines.datasets import robot_of
from pipelines.learning_data import LearningData, learning_data
from pipelines.progress import bar, say
from pipelines.provenance import code_version
from pipelines.registry import Registered, load, models
from pipelines.workspace import Workspace
from services.lake.schemas import SCHEMAS

EXPERIMENT = "evaluation"


@dataclass(frozen=True)
class Trial:
    """One replanner to be rolled out.

    Attributes:
        evaluation_id: Its identity: name and a digest of model, data, weights and testbed.
        label: What tables and figures call it.
        model_id: Its model; None for the trajectory library.
        weights: w of its nearest-neighbour look-up.
    """

    evaluation_id: str
    label: str
    model_id: str | None
    weights: TaskWeights


@dataclass(frozen=True)
class Tried:
    """What came out of a trial."""

    rollouts: list[Rollout]
    summary: ReplannerSummary
    nbytes: int


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
        replanner = build_replanner(model, self._data.training, trial.weights)
        rollouts = run_rollouts(
            replanner, self._courses, self._starts, self._section.rollout, self._robot
        )
        return Tried(rollouts, summarise(rollouts, self._robot), replanner.nbytes)


def trials(config: Configuration, data: LearningData, models: Sequence[Registered]) -> list[Trial]:
    """The replanners that a configuration asks for with these data and models."""
    section = config.evaluation
    candidates: list[tuple[str, str | None]] = [(m.label, m.model_id) for m in models]
    if section.library:
        candidates.append(("trajectory library", None))
    made = []
    for name, model_id in candidates:
        # The unimodal regressor looks nothing up, so weights make no difference to it.
        choices = section.weights[:1] if name.startswith("unimodal") else section.weights
        for weights in choices:
            label = name
            if len(choices) > 1:
                label += f" w={','.join(f'{value:g}' for value in weights.values)}"
            digest = fingerprint(
                model_id, data.identity, weights, section.rollout, section.seed, section.rollouts
            )
            slug = name.split(" seed")[0].lower().replace(" ", "-")
            made.append(Trial(f"{slug}-{digest}", label, model_id, weights))
    return made


def evaluate(
    config: Configuration,
    workspace: Workspace,
    dataset_id: str,
    model_ids: Sequence[str] | None = None,
) -> list[str]:
    """Roll out what has not been; returns the ids of all evaluations that are asked for.

    Args:
        config: Rollouts, weights, testbed.
        workspace: The home.
        dataset_id: The data set.
        model_ids: Models to evaluate; None for all of the data set.
    """
    data = learning_data(config, workspace, dataset_id)
    known = models(workspace, dataset_id, data.segmentation_id, model_ids)
    wanted = trials(config, data, known)
    done = _done(workspace)
    missing = [trial for trial in wanted if trial.evaluation_id not in done]
    if missing:
        _evaluate_missing(config, workspace, data, missing)
    else:
        say(f"evaluate: all {len(wanted)} replanners are evaluated already")
    return [trial.evaluation_id for trial in wanted]


def _done(workspace: Workspace) -> set[str]:
    if not workspace.lake.exists("evaluations"):
        return set()
    rows = workspace.lake.read("evaluations", ["evaluation_id"])
    return set(rows["evaluation_id"].to_pylist())


def _evaluate_missing(
    config: Configuration, workspace: Workspace, data: LearningData, missing: list[Trial]
) -> None:
    robot = robot_of(workspace, data.dataset_id)
    used = {trial.model_id for trial in missing if trial.model_id is not None}
    loaded = {model_id: load(workspace, model_id) for model_id in sorted(used)}
    experiment = workspace.tracker.experiment(EXPERIMENT)
    make_worker = functools.partial(EvaluateWorker, data, loaded, robot, config.evaluation)
    failed: list[str] = []
    with (
        workspace.cluster(len(missing)) as cluster,
        bar("Rolling out", len(missing)) as progress,
    ):
        for outcome in cluster.stream(make_worker, missing):
            if outcome.error is None:
                _record(config, workspace, experiment, data, robot, outcome.item, outcome.value)
            else:
                failed.append(f"{outcome.item.label} ({outcome.error})")
            progress.advance(note=outcome.item.label)
    if failed:
        raise LmtrError(f"evaluate: failed for {'; '.join(failed)}; the others are kept")


def _record(
    config: Configuration,
    workspace: Workspace,
    experiment: str,
    data: LearningData,
    robot: RobotModel,
    trial: Trial,
    tried: Tried,
) -> None:
    """Log the run, then append its rollouts, and last the evaluation that makes them count."""
    metrics = {**records.summary_metrics(tried.summary), "nbytes": float(tried.nbytes)}
    parameters = {
        "replanner": trial.label,
        "model_id": trial.model_id or "",
        **{f"weight.{key}": value for key, value in trial.weights.model_dump().items()},
        "rollouts": config.evaluation.rollouts,
        "seed": config.evaluation.seed,
        **{f"rollout.{k}": v for k, v in config.evaluation.rollout.model_dump().items()},
        **data.provenance,
    }
    tags = {
        "evaluation_id": trial.evaluation_id,
        "code_version": code_version(),
        "stage": "evaluate",
    }
    with workspace.tracker.run(experiment, trial.evaluation_id, parameters, tags) as run:
        run.metrics((key, value, 0) for key, value in metrics.items())
        longest = max(tried.rollouts, key=lambda rollout: rollout.end_time)
        run.figure(motion_figure(longest.motion, longest.obstacles_W, trial.label), "rollout.png")
        run_id = run.id
    rows = [_rollout_row(trial, data, robot, rollout) for rollout in tried.rollouts]
    workspace.lake.append(
        "rollouts",
        pa.Table.from_pylist(rows, schema=SCHEMAS["rollouts"]),
        app_id=f"rollouts/{trial.evaluation_id}",
        number=1,
    )
    row = {
        "evaluation_id": trial.evaluation_id,
        "dataset_id": data.dataset_id,
        "segmentation_id": data.segmentation_id,
        "replanner": trial.label,
        "model_id": trial.model_id,
        "weights": list(trial.weights.values),
        "settings": config.evaluation.model_dump_json(),
        "seed": config.evaluation.seed,
        "summary": list(metrics.items()),
        "segments_version": data.version,
        "mlflow_run_id": run_id,
        "code_version": code_version(),
        "created_at": records.now(),
    }
    workspace.lake.append(
        "evaluations",
        pa.Table.from_pylist([row], schema=SCHEMAS["evaluations"]),
        app_id=f"evaluations/{trial.evaluation_id}",
        number=1,
    )


def _rollout_row(
    trial: Trial, data: LearningData, robot: RobotModel, rollout: Rollout
) -> records.Row:
    limit = Criteria().forward_limit
    violation = forward_violation(rollout.motion, robot, limit)
    path = rollout.motion.base_position_W[:, 0]
    return {
        "rollout_id": f"{trial.evaluation_id}-{rollout.index:03d}",
        "evaluation_id": trial.evaluation_id,
        "dataset_id": data.dataset_id,
        "replanner": trial.label,
        "index": rollout.index,
        "seed": rollout.seed,
        "outcome": "diverged" if rollout.diverged else "completed",
        "reason": str(rollout.outcome) if rollout.diverged else None,
        "duration_s": rollout.end_time,
        "distance_m": float(path[-1] - path[0]),
        "obstacles": rollout.obstacles_W.ravel().tolist(),
        "clearances": obstacle_clearances(rollout.motion, rollout.obstacles_W).ravel().tolist(),
        "violations": violation[rollout.motion.contact].tolist(),
        "velocity_jumps": rollout.velocity_jump.tolist(),
        "foot_jumps": rollout.foot_jump.ravel().tolist(),
        "disagreements": rollout.disagreements.ravel().tolist(),
        "plan_seconds": rollout.plan_seconds.tolist(),
        "created_at": records.now(),
        **records.motion_columns(rollout.motion),
    }
