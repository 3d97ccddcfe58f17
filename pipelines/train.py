"""Stage 3: a sweep of trainings, one model per latent dimension and seed."""

from collections.abc import Mapping
from dataclasses import dataclass

from lmtr.errors import ModelError
from lmtr.figures.learning import learning_figure
from lmtr.models import checkpoint
from lmtr.models.settings import ModelSettings, TrainingSettings
from lmtr.models.trained import TrainedModel
from lmtr.models.training import train as fit
from lmtr.robot.model import RobotModel
from pipelines import records, training_log
from pipelines.config import Configuration, fingerprint
from pipelines.datasets import configuration_of
from pipelines.learning_data import LearningData
from pipelines.model_registration import register
from pipelines.progress import Bar, bar, say
from pipelines.provenance import code_version
from pipelines.registry import is_trained
from pipelines.stopping import Stop, stop_on_signals
from pipelines.turns import beside_others
from pipelines.workspace import Workspace
from services.cluster import Done, Report, Sweep, Trial


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

    @property
    def label(self) -> str:
        """What people call it; of one sweep no two are alike."""
        return f"{self.model.name} seed {self.optimizer.seed}"


def jobs(config: Configuration, data: LearningData) -> list[Job]:
    """The models that a configuration asks for on these data."""
    made = []
    for model, optimizer in config.training.plans():
        digest = fingerprint(model, optimizer, data.identity)
        made.append(Job(model, optimizer, f"{model.name.lower()}-s{optimizer.seed}-{digest}"))
    return made


def train(config: Configuration, workspace: Workspace, data: LearningData) -> list[str]:
    """Train what is missing; returns the ids of all models that the configuration asks for.

    Raises:
        ModelError: Some could not be trained; the others are kept.
        KeyboardInterrupt: The user stopped it; models that were finished are kept.
    """
    wanted = jobs(config, data)
    missing = [job for job in wanted if not is_trained(workspace, job.model_id)]
    if not missing:
        say(f"train: all {len(wanted)} models are there already")
        return [job.model_id for job in wanted]
    with beside_others(workspace.home, "train", shared=True):
        experiment = workspace.tracker.experiment(training_log.EXPERIMENT)
        with training_log.sweep_run(workspace, experiment, config, data, len(wanted)) as parent:
            _train_missing(workspace, data, missing, experiment, parent.id)
    return [job.model_id for job in wanted]


def train_one(job: Job, shared: tuple[LearningData, RobotModel], report: Report) -> TrainedModel:
    """Train one model; runs in a worker process."""
    data, robot = shared
    return fit(
        job.model,
        job.optimizer,
        data.training,
        data.validation,
        robot,
        provenance={**data.provenance, "model_id": job.model_id, "code_version": code_version()},
        report=lambda record: report({"epoch": record.epoch, "loss": record.loss}),
    )


def _train_missing(
    workspace: Workspace, data: LearningData, missing: list[Job], experiment: str, parent: str
) -> None:
    robot = configuration_of(workspace, data.dataset_id).dataset.robot
    epochs = sum(job.optimizer.epochs for job in missing)
    stop = Stop("finished models are kept, those under way are given up")
    with (
        workspace.cluster(len(missing)) as cluster,
        stop_on_signals(stop),
        bar("Training, epochs", epochs) as progress,
    ):
        keeper = _Keeper(workspace, data, experiment, parent, progress, len(missing))
        cluster.sweep(
            Sweep(
                train_one,
                [Trial(job.model_id, job) for job in missing],
                (data, robot),
                keeper.on_report,
                keeper.on_done,
                stop,
                missing[0].optimizer.device,
            )
        )
    if keeper.failed:
        raise ModelError(
            f"training failed for {'; '.join(keeper.failed)}; the other models are kept"
        )
    if keeper.kept < len(missing):
        raise KeyboardInterrupt


class _Keeper:
    """Hears of trials in the driver, and keeps the models that come out."""

    def __init__(
        self,
        workspace: Workspace,
        data: LearningData,
        experiment: str,
        parent: str,
        progress: Bar,
        total: int,
    ) -> None:
        self._workspace, self._data = workspace, data
        self._experiment, self._parent = experiment, parent
        self._progress, self._total = progress, total
        self._epochs: dict[str, int] = {}
        self.kept = 0
        self.failed: list[str] = []

    def on_report(self, trial: Trial[Job], metrics: Mapping[str, float]) -> None:
        """Show how far a model is."""
        epoch, epochs = int(metrics["epoch"]), trial.config.optimizer.epochs
        self._progress.piece(trial.config.label, epoch, epochs, f"loss {metrics['loss']:.3f}")
        self._advance(trial, epoch)

    def on_done(self, trial: Trial[Job], done: Done[TrainedModel]) -> None:
        """Keep a model, or why there is none."""
        job = trial.config
        if done.result is None:
            self.failed.append(f"{job.model_id} ({done.error})")
            said = f"failed: {done.error}"
        else:
            record(self._workspace, self._data, job, done, (self._experiment, self._parent))
            self.kept += 1
            said = _result(done.result)
        self._progress.drop(job.label)
        self._advance(trial, job.optimizer.epochs)
        say(f"train: {job.model_id}: {said}")

    def _advance(self, trial: Trial[Job], epoch: int) -> None:
        # A trial that is begun again counts from where it was.
        before = self._epochs.get(trial.name, 0)
        self._epochs[trial.name] = max(before, epoch)
        note = f"{self.kept} of {self._total} models done"
        self._progress.advance(max(0, epoch - before), note)


def record(
    workspace: Workspace,
    data: LearningData,
    job: Job,
    done: Done[TrainedModel],
    place: tuple[str, str],
) -> None:
    """Log and register a model, put it into its folder, and then make it known to the lake.

    Args:
        workspace: The home.
        data: What it was trained on.
        job: What was asked for.
        done: The model, and when it was trained.
        place: Experiment and parent run.
    """
    model = done.result
    assert model is not None, "what failed is not recorded"
    folder, metrics = workspace.models.folder(job.model_id), training_log.best_metrics(model)
    experiment, parent = place
    # A driver that was killed here before has left the run of this model half made.
    with workspace.tracker.run(
        experiment,
        job.label,
        training_log.model_params(job.model, job.optimizer, data),
        training_log.model_tags(job.model, job.model_id, data),
        identity=job.model_id,
        parent=parent,
        began=done.began,
    ) as run:
        run.metrics(training_log.learning_curve(model.history))
        run.metrics((f"best.{key}", value, 0) for key, value in metrics.items())
        run.metrics([("train_seconds", done.seconds, 0)])
        history = records.learning_history(model.history)
        run.figure(learning_figure({job.model.name: history}), "learning.png")
        checkpoint.save(model, folder)
        run.artifacts(folder, "model")
        register(workspace, data, job.model_id, model, run.id)
    workspace.models.publish(job.model_id)
    settings = {
        "model": job.model.model_dump(mode="json"),
        "optimizer": job.optimizer.model_dump(mode="json"),
    }
    row = {
        "model_id": job.model_id,
        "dataset_id": data.dataset_id,
        "segmentation_id": data.segmentation_id,
        "segments_version": data.version,
        "latent": job.model.latent,
        "seed": job.optimizer.seed,
        "settings": records.to_json(settings),
        "metrics": list(metrics.items()),
        "folder": job.model_id,
        "mlflow_run_id": run.id,
        "code_version": code_version(),
        "created_at": records.now(),
    }
    workspace.lake.append_rows("models", [row], app_id=f"models/{job.model_id}")


def _result(model: TrainedModel) -> str:
    metrics = training_log.best_metrics(model)
    return (
        f"{model.settings.name}: reconstruction {metrics['reconstruction']:.3f}, "
        f"KL {metrics['kl']:.1f} nats"
    )
