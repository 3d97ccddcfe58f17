"""Which models and evaluations the lake knows, and what people call them."""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from lmtr.errors import DataError, ModelError
from lmtr.models import checkpoint
from lmtr.models.settings import ModelSettings
from lmtr.models.trained import TrainedModel
from pipelines.segment import selection
from pipelines.workspace import Workspace


@dataclass(frozen=True)
class Registered:
    """A trained model that the lake knows.

    Attributes:
        model_id: Its identity.
        label: What tables and figures call it: LMTR-n or unimodal, told apart where need be.
        latent: Latent dimension n.
        seed: Training seed.
    """

    model_id: str
    label: str
    latent: int
    seed: int


def is_trained(workspace: Workspace, model_id: str) -> bool:
    """Whether a model is both recorded in the lake and whole on disk."""
    lake = workspace.lake
    if not lake.exists("models"):
        return False
    if lake.read("models", ["model_id"], where=f"model_id = '{model_id}'").num_rows == 0:
        return False
    try:
        load(workspace, model_id)
    except ModelError:
        return False
    return True


def load(workspace: Workspace, model_id: str) -> TrainedModel:
    """Read a model, after fetching it from the home's object store if need be.

    Raises:
        ModelError: Its folder is missing or damaged.
        StoreError: The object store cannot be read, or the model is damaged there.
    """
    return checkpoint.load(workspace.models.fetched(model_id))


def models(
    workspace: Workspace, dataset_id: str, cut: str, ids: Sequence[str] | None = None
) -> list[Registered]:
    """Models of a data set and cut, by latent dimension and seed.

    Args:
        workspace: The home.
        dataset_id: The data set.
        cut: How it was cut.
        ids: Only these; None for all.

    Raises:
        DataError: None of them is there.
    """
    rows = workspace.lake.read(
        "models",
        ["model_id", "latent", "seed", "settings"],
        where=selection(dataset_id, cut),
        order_by="latent, seed, created_at",
    ).to_pylist()
    rows = [row for row in rows if ids is None or row["model_id"] in ids]
    if not rows:
        raise DataError(
            f"data set {dataset_id!r} (cut {cut}) has no trained model; run `lmtr train` first"
        )
    names = [
        ModelSettings.model_validate(json.loads(row["settings"])["model"]).name for row in rows
    ]
    seeds = [f"{name} seed {row['seed']}" for name, row in zip(names, rows, strict=True)]
    digests = [row["model_id"].rsplit("-", 1)[-1] for row in rows]
    named, seeded = Counter(names), Counter(seeds)
    labels = [
        name if named[name] == 1 else seed if seeded[seed] == 1 else f"{seed} ({digest})"
        for name, seed, digest in zip(names, seeds, digests, strict=True)
    ]
    return [
        Registered(row["model_id"], label, row["latent"], row["seed"])
        for row, label in zip(rows, labels, strict=True)
    ]


def evaluation_ids(workspace: Workspace, dataset_id: str, cut: str) -> list[str]:
    """Evaluations of a data set and cut that can be compared: on the newest one's testbed.

    Those that only chose weights are left out, and the expert's. The library comes last.

    Raises:
        DataError: There is none.
    """
    rows = workspace.lake.read(
        "evaluations",
        ["evaluation_id", "settings", "created_at"],
        # Evaluations of an older schema have no purpose: they were all reported.
        where=f"{selection(dataset_id, cut)} AND coalesce(purpose, 'report') = 'report' "
        "AND coalesce(policy, '') <> 'expert'",
        order_by="model_id IS NULL, replanner, created_at",
    ).to_pylist()
    if not rows:
        raise DataError(
            f"data set {dataset_id!r} (cut {cut}) has no evaluation; run `lmtr evaluate` first"
        )
    testbed = max(rows, key=lambda row: row["created_at"])["settings"]
    return [row["evaluation_id"] for row in rows if row["settings"] == testbed]
