"""A complete replanner as one folder, to plan with where there is no data set, Ray or tracker.

``replanner.json`` says what it is and what made it; ``library.safetensors`` holds the tasks that
are looked up, in single precision, with their modes (LMTR) or segments (trajectory library), or the
layers of π_N; ``model/`` is the model's own folder (:mod:`lmtr.models.checkpoint`). Loading needs
NumPy, not torch.
"""

import hashlib
import json
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load_file as tensors_from_file
from safetensors.numpy import save as tensors_to_bytes

from lmtr.errors import DataError, ModelError
from lmtr.models import checkpoint
from lmtr.models.data import TrainingData
from lmtr.models.trained import TrainedModel
from lmtr.policies.distance import TaskWeights
from lmtr.policies.gaussian_policy import GaussianModePolicy
from lmtr.policies.mode_library import ModeLibrary, mode_library
from lmtr.policies.mode_policy import ModePolicy, NearestModePolicy, ZeroModePolicy
from lmtr.replanners.build import build_replanner
from lmtr.replanners.latent_mode import LatentModeReplanner
from lmtr.replanners.replanner import Replanner
from lmtr.replanners.selecting import SelectingReplanner, Selection
from lmtr.replanners.trajectory_library import TrajectoryLibraryReplanner
from lmtr.replanners.unimodal import UnimodalReplanner
from lmtr.robot.model import RobotModel
from lmtr.vectors.layout import TASK_LAYOUT
from lmtr.vectors.scaling import Standardiser

FORMAT = 2
"""Version of the folder's contents."""

DESCRIPTION = "replanner.json"
LIBRARY = "library.safetensors"
MODEL = "model"

Tensors = dict[str, NDArray[Any]]

KeptPolicy = GaussianModePolicy | ZeroModePolicy
"""Policies beside π_nbr that can be kept."""


def save(
    folder: Path,
    model: TrainedModel | None,
    library: TrainingData,
    weights: TaskWeights,
    robot: RobotModel,
    *,
    policy: KeptPolicy | None = None,
    selection: Selection | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> None:
    """Write a replanner's folder, whole or not at all.

    Args:
        folder: Where to; its parent is made if need be.
        model: As for :func:`~lmtr.replanners.build.build_replanner`, like all that follow.
        library: Expert segments; not kept by a replanner that looks nothing up.
        weights: w of the task distance.
        robot: The robot.
        policy: π_N or z = 0; None for π_nbr.
        selection: Choose among the plans of several nearest tasks.
        provenance: What made it, as plain JSON types.

    Raises:
        ModelError: The folder is there already, the model is of another robot, or model, policy
            and selection do not go together.
    """
    if folder.exists():
        raise ModelError(f"replanner {folder}: it is there already; choose another folder")
    if model is not None and model.robot != robot:
        raise ModelError(
            f"replanner {folder}: its model is of robot {model.robot.name!r}, not {robot.name!r}; "
            "save it with its own robot"
        )
    if policy is not None and (model is None or model.latent == 0):
        raise ModelError(
            f"replanner {folder}: policy {policy.name!r} selects modes, which need a model with "
            "latent ≥ 1; leave the policy out"
        )
    # This refuses what else does not go together.
    made = build_replanner(model, library, weights, policy=policy, selection=selection, robot=robot)
    tensors = tensors_to_bytes(_tensors(model, library, policy))
    description = {
        "format": FORMAT,
        "kind": _kind(model),
        "name": made.name,
        "policy": "nearest" if policy is None else policy.name,
        "policy_hidden": policy.hidden if isinstance(policy, GaussianModePolicy) else None,
        "robot": robot.model_dump(mode="json"),
        "task_layout": TASK_LAYOUT.metadata(),
        "weights": weights.model_dump(mode="json"),
        "selection": None if selection is None else selection.model_dump(mode="json"),
        "library_sha256": hashlib.sha256(tensors).hexdigest(),
        "provenance": dict(provenance or {}),
    }
    folder.parent.mkdir(parents=True, exist_ok=True)
    draft = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    try:
        (draft / LIBRARY).write_bytes(tensors)
        (draft / DESCRIPTION).write_text(json.dumps(description, indent=1), encoding="utf-8")
        if model is not None:
            checkpoint.save(model, draft / MODEL)
        draft.chmod(0o755)
        draft.rename(folder)
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        raise


def load(folder: Path, *, robot: RobotModel | None = None) -> Replanner:
    """Read a replanner that :func:`save` wrote.

    Its plans are those of the replanner that was saved, to single precision.

    Args:
        folder: Its folder.
        robot: The robot it must be of; None takes any.

    Raises:
        ModelError: It is missing, damaged, or of another layout or robot.
    """
    description = _read_description(folder)
    try:
        TASK_LAYOUT.require_equal(type(TASK_LAYOUT).from_metadata(description["task_layout"]))
        own = RobotModel.model_validate(description["robot"])
        weights = TaskWeights.model_validate(description["weights"])
        chosen = description["selection"]
        selection = None if chosen is None else Selection.model_validate(chosen)
        tensors = _read_tensors(folder, description["library_sha256"])
        if robot is not None and robot != own:
            raise DataError(f"it must be of robot {robot.name!r}, got {own.name!r}")
        if description["kind"] == "library":
            plain: Any = _library(tensors, weights)
        else:
            model = checkpoint.load(folder / MODEL, robot=own)
            plain = _of_model(model, description, tensors, weights)
    except (KeyError, TypeError, ValueError, DataError) as error:
        raise ModelError(
            f"replanner {folder}: {DESCRIPTION} and {LIBRARY} do not make a replanner "
            f"({' '.join(str(error).split())}); save it again"
        ) from error
    return plain if selection is None else SelectingReplanner(plain, selection, own)


def provenance(folder: Path) -> dict[str, Any]:
    """What made a saved replanner, and its digest, as plain JSON types.

    Raises:
        ModelError: The folder is no replanner's.
    """
    description = _read_description(folder)
    return {**description["provenance"], "library_sha256": description["library_sha256"]}


def _kind(model: TrainedModel | None) -> str:
    if model is None:
        return "library"
    return "latent mode" if model.latent else "unimodal"


def _tensors(
    model: TrainedModel | None, library: TrainingData, policy: KeptPolicy | None
) -> Tensors:
    if model is None:
        return {**_single(x=library.x, tau=library.tau), **_scaling(library)}
    if isinstance(policy, GaussianModePolicy):
        return checkpoint.network_tensors(policy.name, policy.network)
    if model.latent == 0 or policy is not None:
        return {}
    modes = mode_library(model, library.x, library.tau)
    return _single(x=modes.x, z=modes.z)


def _single(**arrays: NDArray[np.float64]) -> Tensors:
    return {name: np.ascontiguousarray(a, dtype=np.float32) for name, a in arrays.items()}


def _scaling(library: TrainingData) -> Tensors:
    scaling = Standardiser.fit(TASK_LAYOUT, library.x)
    return {f"scaling.{name}": array for name, array in scaling.to_dict().items()}


def _library(tensors: Tensors, weights: TaskWeights) -> TrajectoryLibraryReplanner:
    found = {
        name.removeprefix("scaling."): array
        for name, array in tensors.items()
        if name.startswith("scaling.")
    }
    scaling = Standardiser.from_dict(TASK_LAYOUT, found)
    return TrajectoryLibraryReplanner(tensors["x"], tensors["tau"], weights, scaling)


def _of_model(
    model: TrainedModel, description: Mapping[str, Any], tensors: Tensors, weights: TaskWeights
) -> Replanner:
    if model.latent == 0:
        return UnimodalReplanner(model)
    policy: ModePolicy
    if description["policy"] == GaussianModePolicy.name:
        sizes = (TASK_LAYOUT.size, *description["policy_hidden"], 2 * model.latent)
        activation = model.settings.activation
        network = checkpoint.network_from(GaussianModePolicy.name, tensors, sizes, activation)
        policy = GaussianModePolicy(network, model.task_scaling)
    elif description["policy"] == ZeroModePolicy.name:
        policy = ZeroModePolicy(model.latent)
    else:
        modes = ModeLibrary(tensors["x"], tensors["z"])
        policy = NearestModePolicy(modes, weights, model.task_scaling)
    return LatentModeReplanner(model.for_planning(), policy)


def _read_description(folder: Path) -> Mapping[str, Any]:
    try:
        description = json.loads((folder / DESCRIPTION).read_bytes())
    except (OSError, ValueError) as error:
        raise ModelError(
            f"replanner {folder}: {DESCRIPTION} is missing or damaged ({error}); name the folder "
            "of a saved replanner"
        ) from error
    found = description.get("format") if isinstance(description, dict) else None
    if found != FORMAT:
        raise ModelError(
            f"replanner {folder}: {DESCRIPTION} must be of format {FORMAT}, got {found}; load it "
            "with the version that wrote it"
        )
    return dict(description)


def _read_tensors(folder: Path, digest: str) -> Tensors:
    path = folder / LIBRARY
    try:
        with path.open("rb") as file:
            found = hashlib.file_digest(file, "sha256").hexdigest()
        tensors: Tensors = tensors_from_file(path)
    except (OSError, SafetensorError) as error:
        raise DataError(f"{LIBRARY} is missing or damaged: {error}") from error
    if found != digest:
        raise DataError(f"{LIBRARY} is not the file that {DESCRIPTION} describes")
    return tensors
