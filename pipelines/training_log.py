"""What the tracker is told of a sweep and of each model.

One run stands for the sweep, those of its models lie below it. Parameters and final metrics have
short names and are the same for all models, since MLflow's pages compare by name.
"""

from collections.abc import Iterator
from contextlib import AbstractContextManager

from lmtr.models.record import EpochRecord
from lmtr.models.settings import ModelSettings, TrainingSettings
from lmtr.models.trained import TrainedModel
from pipelines.config import Configuration, fingerprint
from pipelines.learning_data import LearningData
from pipelines.provenance import code_version
from pipelines.workspace import Workspace
from services.tracking.run import Run

EXPERIMENT = "training"


def sweep_run(
    workspace: Workspace, experiment: str, config: Configuration, data: LearningData, models: int
) -> AbstractContextManager[Run]:
    """The run of a sweep; the same data and configuration go on with the one that is there."""
    digest = fingerprint(config.training, data.identity)
    asked = config.training
    params = {
        "models": models,
        "latents": list(asked.latent),
        "seeds": list(asked.seeds),
        **_data_params(data),
    }
    tags = {
        "stage": "train",
        "kind": "sweep",
        "dataset_id": data.dataset_id,
        "segmentation_id": data.segmentation_id,
        "code_version": code_version(),
        "configuration": digest,
    }
    name = f"sweep-{data.dataset_id}-{digest}"
    return workspace.tracker.run(experiment, name, params, tags, identity=name)


def model_params(
    model: ModelSettings, optimizer: TrainingSettings, data: LearningData
) -> dict[str, object]:
    """What was chosen for a model, by names that fit on an axis."""
    weights = model.loss_weights
    return {
        "latent": model.latent,
        "kappa": model.kappa,
        "seed": optimizer.seed,
        "reduction": model.reduction,
        "loss_scale": weights.scale,
        "loss_base": weights.base,
        "loss_times": weights.times,
        "loss_motion": weights.motion,
        "loss_forces": weights.forces,
        "loss_start": weights.start,
        "hidden": "-".join(map(str, model.hidden)),
        "activation": model.activation,
        "task_noise": model.task_noise,
        "epochs": optimizer.epochs,
        "batch_size": optimizer.batch_size,
        "learning_rate": optimizer.learning_rate,
        "schedule": optimizer.schedule,
        "patience": optimizer.patience,
        "device": optimizer.device,
        **_data_params(data),
    }


def model_tags(model: ModelSettings, model_id: str, data: LearningData) -> dict[str, str]:
    """What a model's run is found by."""
    return {
        "stage": "train",
        "kind": "model",
        "model": model.name,
        "model_id": model_id,
        "dataset_id": data.dataset_id,
        "segmentation_id": data.segmentation_id,
        "code_version": code_version(),
    }


def best_metrics(model: TrainedModel) -> dict[str, float]:
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


def learning_curve(history: tuple[EpochRecord, ...]) -> Iterator[tuple[str, float, int]]:
    """Metrics by epoch."""
    for record in history:
        for key in ("loss", "reconstruction", "kl", "learning_rate"):
            yield f"train.{key}", getattr(record, key), record.epoch
        if record.validation is not None:
            look = record.validation.model_dump()
            errors = look.pop("errors")
            for key, value in {**look, **errors}.items():
                yield f"validation.{key}", value, record.epoch


def _data_params(data: LearningData) -> dict[str, object]:
    return {
        "dataset_id": data.dataset_id,
        "segmentation_id": data.segmentation_id,
        "segments": len(data.training.x),
        "held_out": len(data.validation.x),
        "mirrored": data.mirrored,
        "segments_version": data.version,
    }
