"""Stage 3: train one model per latent dimension and seed; log each to the tracker."""

import functools
from collections.abc import Iterator
from dataclasses import dataclass

from lmtr.errors import ModelError
from lmtr.figures.learning import learning_figure
from lmtr.models import checkpoint
from lmtr.models.record import EpochRecord
from lmtr.models.settings import ModelSettings, TrainingSettings
from lmtr.models.trained import TrainedModel
from lmtr.models.training import train as fit
from lmtr.robot.model import RobotModel
from pipelines import records
from pipelines.config import Configuration, fingerprint
from pipelines.datasets import configuration_of
from pipelines.learning_data import LearningData
from pipelines.progress import bar, say
from pipelines.provenance import code_version
from pipelines.registry import is_trained
from pipelines.turns import beside_others
from pipelines.workspace import Workspace

EXPERIMENT = "training"


@dataclass(frozen=True)
class Job:
    """One model to train.

    Attributes:
        model: Its shape and loss.
        optimizer: How it is fitted.
        model_id: Its identity: name, seed and a digest of settings and data.
    """

    model: ModelSettings
    optimizer: TrainingSettings
    model_id: str


class TrainWorker:
    """Trains models in a worker process, which holds the data once."""

    def __init__(self, data: LearningData, robot: RobotModel) -> None:
        self._data = data
        self._robot = robot

    def __call__(self, job: Job) -> TrainedModel:
        """The trained model of one job."""
        return fit(
            job.model,
            job.optimizer,
            self._data.training,
            self._data.validation,
            self._robot,
            provenance={
                **self._data.provenance,
                "model_id": job.model_id,
                "code_version": code_version(),
            },
        )


def jobs(config: Configuration, data: LearningData) -> list[Job]:
    """The models that a configuration asks for on these data."""
    made = []
    for model, optimizer in config.training.plans():
        digest = fingerprint(model, optimizer, data.identity)
        made.append(Job(model, optimizer, f"{model.name.lower()}-s{optimizer.seed}-{digest}"))
    return made


def train(config: Configuration, workspace: Workspace, data: LearningData) -> list[str]:
    """Train what is missing; returns the ids of all models that the configuration asks for."""
    wanted = jobs(config, data)
    missing = [job for job in wanted if not is_trained(workspace, job.model_id)]
    if missing:
        with beside_others(workspace.home, "train", shared=True):
            _train_missing(workspace, data, missing)
    else:
        say(f"train: all {len(wanted)} models are there already")
    return [job.model_id for job in wanted]


def _train_missing(workspace: Workspace, data: LearningData, missing: list[Job]) -> None:
    robot = configuration_of(workspace, data.dataset_id).dataset.robot
    experiment = workspace.tracker.experiment(EXPERIMENT)
    make_worker = functools.partial(TrainWorker, data, robot)
    failed: list[str] = []
    with (
        workspace.cluster(len(missing)) as cluster,
        bar("Training models", len(missing)) as progress,
    ):
        for outcome in cluster.stream(make_worker, missing):
            job: Job = outcome.item
            if outcome.error is None:
                _record(workspace, experiment, data, job, outcome.value)
                progress.advance(note=_result(outcome.value))
                say(f"train: {job.model_id}: {_result(outcome.value)}")
            else:
                failed.append(f"{job.model_id} ({outcome.error})")
                progress.advance(note=f"{job.model.name} failed")
    if failed:
        raise ModelError(f"training failed for {'; '.join(failed)}; the other models are kept")


def _record(
    workspace: Workspace, experiment: str, data: LearningData, job: Job, model: TrainedModel
) -> None:
    """Log the run, put the model into its folder, and then make it known to the lake."""
    folder = workspace.models.folder(job.model_id)
    settings = {
        "model": job.model.model_dump(mode="json"),
        "optimizer": job.optimizer.model_dump(mode="json"),
    }
    tags = {"model_id": job.model_id, "code_version": code_version(), "stage": "train"}
    with workspace.tracker.run(
        experiment, job.model_id, {**settings, **data.provenance}, tags
    ) as run:
        run.metrics(_learning_curve(model.history))
        run.metrics((f"best.{key}", value, 0) for key, value in _metrics(model).items())
        history = records.learning_history(model.history)
        run.figure(learning_figure({job.model.name: history}), "learning.png")
        checkpoint.save(model, folder)
        run.artifacts(folder, "model")
    workspace.models.publish(job.model_id)
    row = {
        "model_id": job.model_id,
        "dataset_id": data.dataset_id,
        "segmentation_id": data.segmentation_id,
        "segments_version": data.version,
        "latent": job.model.latent,
        "seed": job.optimizer.seed,
        "settings": records.to_json(settings),
        "metrics": list(_metrics(model).items()),
        "folder": job.model_id,
        "mlflow_run_id": run.id,
        "code_version": code_version(),
        "created_at": records.now(),
    }
    workspace.lake.append_rows("models", [row], app_id=f"models/{job.model_id}")


def _metrics(model: TrainedModel) -> dict[str, float]:
    """What the validation data say of the weights that were kept."""
    best = model.best_epoch
    if best is None or best.validation is None:
        return {}
    look = best.validation
    return {
        "epoch": float(best.epoch),
        "loss": look.loss,
        "reconstruction": look.reconstruction,
        "kl": look.kl,
        "active_dimensions": float(look.active_dimensions),
        **look.errors.model_dump(),
    }


def _learning_curve(history: tuple[EpochRecord, ...]) -> Iterator[tuple[str, float, int]]:
    for record in history:
        for key in ("loss", "reconstruction", "kl", "learning_rate"):
            yield f"train.{key}", getattr(record, key), record.epoch
        if record.validation is not None:
            look = record.validation.model_dump()
            errors = look.pop("errors")
            for key, value in {**look, **errors}.items():
                yield f"validation.{key}", value, record.epoch


def _result(model: TrainedModel) -> str:
    metrics = _metrics(model)
    return (
        f"{model.settings.name}: reconstruction {metrics['reconstruction']:.3f}, "
        f"KL {metrics['kl']:.1f} nats"
    )
