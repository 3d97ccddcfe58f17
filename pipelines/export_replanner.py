"""A complete replanner of the home as one folder, to plan with elsewhere (docs/planner.md)."""

import difflib
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Literal

import numpy as np

from lmtr.arrays import Array
from lmtr.errors import ConfigurationError, ModelError
from lmtr.models.data import TrainingData
from lmtr.models.trained import TrainedModel
from lmtr.policies.distance import TaskWeights
from lmtr.policies.gaussian_policy import GaussianModePolicy
from lmtr.policies.mode_policy import ZeroModePolicy
from lmtr.replanners import artifact
from lmtr.replanners.replanner import Replanner
from pipelines.config import Configuration
from pipelines.datasets import configuration_of, resolve
from pipelines.learning_data import LearningData, learning_data
from pipelines.provenance import code_version
from pipelines.registry import load
from pipelines.workspace import Workspace

LIBRARY = "library"
"""In the place of a model's id: the trajectory library."""

TIMED_PLANS = 500

Policy = Literal["nearest", "selected", "gaussian", "zero"]
"""Policies that a replanner on its own can have."""


@dataclass(frozen=True)
class Exported:
    """What was written.

    Attributes:
        folder: Where it lies.
        name: The replanner's.
        nbytes: Size of the folder (bytes).
        rows: Segments that it looks up.
        seconds: Times of single plans on validation tasks, after loading it anew (P,) in s.
    """

    folder: Path
    name: str
    nbytes: int
    rows: int
    seconds: Array


def export_replanner(
    config: Configuration,
    workspace: Workspace,
    source: str,
    out: Path,
    *,
    policy: Policy = "nearest",
    weights: TaskWeights | None = None,
    rows: int | None = None,
    dataset_id: str | None = None,
) -> Exported:
    """Write a replanner's folder, whole or not at all, then load it and plan with it.

    Args:
        config: Which segments, as for an evaluation, and how π_N and selection are set.
        workspace: The home.
        source: Id of a model, or ``library``.
        out: The new folder.
        policy: How the mode is selected.
        weights: w of the task distance; the evaluation's first by default.
        rows: Look up at most so many segments, evenly drawn; all by default.
        dataset_id: Data set of the trajectory library; the newest by default. A model has its own.

    Raises:
        ConfigurationError: The folder is there, or the policy does not go with the replanner.
        DataError: There is no such data set.
        ModelError: There is no such model.
    """
    if out.exists():
        raise ConfigurationError(
            f"export: {out} is there already; name a new folder with --out, or remove it first"
        )
    dataset, model = _source(workspace, source, dataset_id)
    _require_fitting(source, model, policy)
    data = learning_data(config, workspace, dataset)
    library = _thinned(data.training, rows)
    weights = weights or config.evaluation.weights[0]
    looked_up = len(library.x) if _looks_up(model, policy) else 0
    kept = None if model is None else _policy(config, model, data.training, policy)
    artifact.save(
        out,
        model,
        library,
        weights,
        configuration_of(workspace, dataset).dataset.robot,
        policy=kept,
        selection=config.evaluation.selection if policy == "selected" else None,
        provenance={
            "model_id": None if model is None else source,
            **data.provenance,
            "library_rows": looked_up,
            "code_version": code_version(),
            "configuration": config.model_dump(mode="json"),
        },
    )
    replanner = artifact.load(out)
    nbytes = sum(file.stat().st_size for file in out.rglob("*") if file.is_file())
    return Exported(out, replanner.name, nbytes, looked_up, _plan_seconds(replanner, data))


def _source(
    workspace: Workspace, source: str, dataset_id: str | None
) -> tuple[str, TrainedModel | None]:
    """The data set and the model that are meant."""
    if source == LIBRARY:
        return resolve(workspace, dataset_id), None
    lake = workspace.lake
    known = (
        {
            row["model_id"]: row["dataset_id"]
            for row in lake.read("models", ["model_id", "dataset_id"]).to_pylist()
        }
        if lake.exists("models")
        else {}
    )
    if source not in known:
        near = difflib.get_close_matches(source, [*known, LIBRARY], n=3, cutoff=0.3)
        raise ModelError(
            f"model {source!r} is not in this home; choose "
            f"{'one like ' + ', '.join(near) if near else LIBRARY} (all of them: "
            '`lmtr query "SELECT model_id FROM models"`)'
        )
    if dataset_id not in (None, known[source]):
        raise ConfigurationError(
            f"export: model {source!r} is of data set {known[source]!r}, not {dataset_id!r}; leave "
            "--dataset out"
        )
    return known[source], load(workspace, source)


def _require_fitting(source: str, model: TrainedModel | None, policy: Policy) -> None:
    allowed: tuple[Policy, ...]
    if model is None:
        allowed = ("nearest", "selected")
    else:
        allowed = ("nearest", "selected", "gaussian", "zero") if model.latent else ("nearest",)
    if policy not in allowed:
        raise ConfigurationError(
            f"export: {source} has no policy {policy!r}; choose with --policy one of: "
            f"{', '.join(allowed)}"
        )


def _looks_up(model: TrainedModel | None, policy: Policy) -> bool:
    return model is None or (model.latent > 0 and policy in ("nearest", "selected"))


def _policy(
    config: Configuration, model: TrainedModel, data: TrainingData, policy: Policy
) -> artifact.KeptPolicy | None:
    if policy == "gaussian":
        from lmtr.models.mode_regressor import fit_mode_regressor  # torch takes a second to import

        network = fit_mode_regressor(model, data, config.evaluation.mode_regressor)
        return GaussianModePolicy(network, model.task_scaling)
    return ZeroModePolicy(model.latent) if policy == "zero" else None


def _thinned(data: TrainingData, rows: int | None) -> TrainingData:
    if rows is None or rows >= len(data.x):
        return data
    chosen = np.linspace(0, len(data.x) - 1, rows).round().astype(np.intp)
    return TrainingData(data.x[chosen], data.tau[chosen])


def _plan_seconds(replanner: Replanner, data: LearningData) -> Array:
    tasks = data.validation.x if len(data.validation.x) else data.training.x
    seconds = np.empty(TIMED_PLANS)
    for call in range(-20, TIMED_PLANS):  # the first few only warm up
        row = call % len(tasks)
        begun = perf_counter()
        replanner.plan(tasks[row : row + 1])
        if call >= 0:
            seconds[call] = perf_counter() - begun
    return seconds
