"""A trained model's folder: ``weights.safetensors`` and ``model.json``, and nothing executable.

A folder appears whole, by one rename, or not at all. Loading refuses what does not fit (another
layout or robot, missing or damaged files) and says what differs.
"""

import hashlib
import json
import os
import tempfile
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError
from safetensors import SafetensorError
from safetensors.numpy import load as tensors_from_bytes
from safetensors.numpy import save as tensors_to_bytes

from lmtr.errors import DataError, ModelError
from lmtr.models.perceptron import Perceptron
from lmtr.models.record import EpochRecord
from lmtr.models.settings import Activation, ModelSettings, TrainingSettings
from lmtr.models.trained import TrainedModel
from lmtr.robot.model import RobotModel
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT, Layout
from lmtr.vectors.scaling import Standardiser

Tensors = dict[str, NDArray[Any]]

FORMAT = 2
"""Version of the folder's contents."""

WEIGHTS = "weights.safetensors"
DESCRIPTION = "model.json"

_HISTORY = TypeAdapter(tuple[EpochRecord, ...])


def save(model: TrainedModel, folder: Path) -> None:
    """Write a model's folder, in the place of an older model if there is one.

    Args:
        model: The model.
        folder: Where to; its parent is made if need be.

    Raises:
        ModelError: The folder holds something else than a model.
    """
    if folder.exists() and not _may_be_replaced(folder):
        raise ModelError(
            f"model {folder}: the folder must be new, empty or a model's, got one that holds "
            "other files; choose another one"
        )
    weights = tensors_to_bytes(_tensors(model))
    description = json.dumps(_description(model, weights), indent=1).encode()
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as scratch:
        draft = Path(scratch, "new")
        draft.mkdir()
        _write(draft / WEIGHTS, weights)
        _write(draft / DESCRIPTION, description)
        if folder.exists():
            # No rename replaces a filled folder: for an instant there is no model, never a part.
            folder.rename(Path(scratch, "old"))
        draft.rename(folder)


def load(
    folder: Path,
    *,
    robot: RobotModel | None = None,
    task_layout: Layout = TASK_LAYOUT,
    segment_layout: Layout = SEGMENT_LAYOUT,
) -> TrainedModel:
    """Read a model that :func:`save` wrote.

    Args:
        folder: Its folder.
        robot: The robot it must be of; None takes any.
        task_layout: The layout of x it must be of.
        segment_layout: The layout of τ it must be of.

    Raises:
        ModelError: It is missing, damaged, or of another layout or robot.
    """
    description = _read_description(folder)
    _require_layout(folder, "task", description, task_layout)
    _require_layout(folder, "segment", description, segment_layout)
    tensors = _read_tensors(folder, description)
    try:
        model = _model(description, tensors, task_layout, segment_layout)
    except (KeyError, TypeError, ValueError, DataError) as error:
        raise ModelError(
            f"model {folder}: {DESCRIPTION} and {WEIGHTS} do not make a model ({_brief(error)}); "
            "train it again"
        ) from error
    if robot is not None:
        _require_robot(folder, model.robot, robot)
    return model


def _description(model: TrainedModel, weights: bytes) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "settings": model.settings.model_dump(mode="json"),
        "training": model.training.model_dump(mode="json"),
        "robot": model.robot.model_dump(mode="json"),
        "layouts": {
            "task": model.task_layout.metadata(),
            "segment": model.segment_layout.metadata(),
        },
        "weights_sha256": hashlib.sha256(weights).hexdigest(),
        "provenance": dict(model.provenance),
        "history": [record.model_dump(mode="json") for record in model.history],
    }


def _model(
    description: Mapping[str, Any], tensors: Tensors, task_layout: Layout, segment_layout: Layout
) -> TrainedModel:
    settings = ModelSettings.model_validate(description["settings"])
    x_size, tau_size, n = task_layout.size, segment_layout.size, settings.latent
    encoder = None
    if n:
        sizes = (tau_size + x_size, *reversed(settings.hidden), 2 * n)
        encoder = network_from("encoder", tensors, sizes, settings.activation)
    return TrainedModel(
        settings=settings,
        training=TrainingSettings.model_validate(description["training"]),
        robot=RobotModel.model_validate(description["robot"]),
        task_scaling=_scaling("task", tensors, task_layout),
        segment_scaling=_scaling("segment", tensors, segment_layout),
        decoder=network_from(
            "decoder", tensors, (n + x_size, *settings.hidden, tau_size), settings.activation
        ),
        encoder=encoder,
        history=_HISTORY.validate_python(description["history"]),
        provenance=description["provenance"],
    )


def _tensors(model: TrainedModel) -> Tensors:
    """Weights in single precision, as trained; scalings in double, as fitted."""
    tensors: Tensors = {}
    for name, network in (("decoder", model.decoder), ("encoder", model.encoder)):
        if network is not None:
            tensors |= network_tensors(name, network)
    for name, scaling in (("task", model.task_scaling), ("segment", model.segment_scaling)):
        for key, array in scaling.to_dict().items():
            tensors[f"{name}_scaling.{key}"] = array
    return tensors


def network_tensors(name: str, network: Perceptron) -> Tensors:
    """The layers of a network in single precision, as trained, under ``name``."""
    tensors: Tensors = {}
    for layer, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        tensors[f"{name}.{layer}.weight"] = weight.astype(np.float32)
        tensors[f"{name}.{layer}.bias"] = bias.astype(np.float32)
    return tensors


def network_from(
    name: str, tensors: Tensors, sizes: tuple[int, ...], activation: Activation
) -> Perceptron:
    """The network that :func:`network_tensors` stored.

    Args:
        name: As it was stored.
        tensors: All tensors of the file.
        sizes: Of its inputs, hidden layers and outputs.
        activation: Its nonlinearity.

    Raises:
        KeyError: A layer is missing.
        ValueError: A layer is of another size.
    """
    weights, biases = [], []
    for layer, shape in enumerate(pairwise(sizes)):
        weight, bias = tensors[f"{name}.{layer}.weight"], tensors[f"{name}.{layer}.bias"]
        if weight.shape != shape or bias.shape != shape[1:]:
            raise ValueError(
                f"layer {layer} of the {name} must be {shape}, got {weight.shape}, {bias.shape}"
            )
        weights.append(weight.astype(np.float64))
        biases.append(bias.astype(np.float64))
    return Perceptron(tuple(weights), tuple(biases), activation)


def _scaling(name: str, tensors: Tensors, layout: Layout) -> Standardiser:
    prefix = f"{name}_scaling."
    arrays = {key.removeprefix(prefix): a for key, a in tensors.items() if key.startswith(prefix)}
    return Standardiser.from_dict(layout, arrays)


def _read_description(folder: Path) -> dict[str, Any]:
    try:
        description = json.loads((folder / DESCRIPTION).read_bytes())
    except FileNotFoundError as error:
        raise ModelError(
            f"model {folder}: there is no {DESCRIPTION}; name the folder of a trained model"
        ) from error
    except ValueError as error:
        raise ModelError(
            f"model {folder}: {DESCRIPTION} is damaged ({error}); train it again"
        ) from error
    found = description.get("format") if isinstance(description, dict) else None
    if found != FORMAT:
        raise ModelError(
            f"model {folder}: {DESCRIPTION} must be of format {FORMAT}, got {found}; "
            "load it with the version that wrote it"
        )
    return dict(description)


def _read_tensors(folder: Path, description: Mapping[str, Any]) -> Tensors:
    try:
        weights = (folder / WEIGHTS).read_bytes()
        tensors: Tensors = tensors_from_bytes(weights)
    except (FileNotFoundError, SafetensorError) as error:
        raise ModelError(
            f"model {folder}: {WEIGHTS} is missing or damaged ({_brief(error)}); train it again"
        ) from error
    # The format notices a file cut short; only the digest notices changed numbers.
    if hashlib.sha256(weights).hexdigest() != description.get("weights_sha256"):
        raise ModelError(
            f"model {folder}: {WEIGHTS} is not the file that {DESCRIPTION} describes "
            "(its SHA-256 differs); restore it or train it again"
        )
    return tensors


def _require_layout(
    folder: Path, name: str, description: Mapping[str, Any], expected: Layout
) -> None:
    try:
        expected.require_equal(Layout.from_metadata(description["layouts"][name]))
    except (KeyError, TypeError, DataError) as error:
        raise ModelError(
            f"model {folder}: its {name} layout does not fit: {_brief(error)}"
        ) from error


def _require_robot(folder: Path, found: RobotModel, expected: RobotModel) -> None:
    names = [n for n in RobotModel.model_fields if getattr(found, n) != getattr(expected, n)]
    if names:
        first = names[0]
        raise ModelError(
            f"model {folder}: it must be of robot {expected.name!r}, got {found.name!r}, which "
            f"differs in {', '.join(names)} ({first}: {getattr(expected, first)!r} against "
            f"{getattr(found, first)!r}); train one for this robot"
        )


def _may_be_replaced(folder: Path) -> bool:
    return folder.is_dir() and {p.name for p in folder.iterdir()} <= {WEIGHTS, DESCRIPTION}


def _write(path: Path, content: bytes) -> None:
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())  # a power cut must not leave an empty file behind the rename


def _brief(error: Exception) -> str:
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        return f"{'.'.join(map(str, first['loc']))}: {first['msg']}"
    return f"missing {error}" if isinstance(error, KeyError) else str(error)
