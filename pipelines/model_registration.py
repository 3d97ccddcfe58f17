"""Trained models in MLflow's model registry, each as a replanner that plans."""

import tempfile
from pathlib import Path

import lmtr
from lmtr.models.trained import TrainedModel
from lmtr.policies.distance import TaskWeights
from lmtr.replanners import artifact
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT
from pipelines import served_replanner
from pipelines.learning_data import LearningData
from pipelines.provenance import code_version
from pipelines.workspace import Workspace
from services.tracking import Servable


def register(
    workspace: Workspace, data: LearningData, model_id: str, model: TrainedModel, run_id: str
) -> str:
    """Register a model once, under the name of its latent dimension; returns its version.

    It plans by π_nbr over the segments it was trained on, with the default weights w.

    Args:
        workspace: The home.
        data: What it was trained on.
        model_id: Its identity; a version that has it already is left as it is.
        model: The model.
        run_id: The tracker's run that recorded it.
    """
    registry, name = workspace.tracker.registry, model.settings.name.lower()
    known = registry.version_of(name, "model_id", model_id)
    if known is not None:
        return known
    tags = {
        "model_id": model_id,
        "dataset_id": data.dataset_id,
        "segmentation_id": data.segmentation_id,
        "code_version": code_version(),
        "latent": str(model.settings.latent),
        "seed": str(model.training.seed),
        "kappa": str(model.settings.kappa),
    }
    told = (
        f"{model.settings.name}, seed {model.training.seed}, κ = {model.settings.kappa:g}, trained "
        f"on {data.dataset_id}: plans τ (264) of tasks x (35) by their nearest neighbours' modes."
    )
    with tempfile.TemporaryDirectory(prefix="lmtr-register-") as scratch:
        folder = Path(scratch, "replanner")
        artifact.save(
            folder, model, data.training, TaskWeights(), model.robot, provenance=dict(tags)
        )
        servable = Servable(
            folder,
            served_replanner.__name__,
            TASK_LAYOUT.size,
            SEGMENT_LAYOUT.size,
            (f"lmtr=={lmtr.__version__}",),
        )
        return registry.register(name, run_id, servable, tags, told)
