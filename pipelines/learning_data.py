"""Segments from the lake as arrays: what models are trained on and libraries are made of."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from lmtr.errors import DataError
from lmtr.models.data import TrainingData
from lmtr.vectors.mirror import mirror_segment, mirror_task
from pipelines.config import Configuration
from pipelines.segment import selection
from pipelines.workspace import Workspace

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LearningData:
    """One data set, cut one way and split by solution.

    Attributes:
        dataset_id: The data set.
        segmentation_id: How it was cut.
        version: Version of the table ``segments`` that was read.
        training: Pairs (x, τ) to learn from, with their mirror images where asked for.
        validation: Pairs held out.
    """

    dataset_id: str
    segmentation_id: str
    version: int
    training: TrainingData
    validation: TrainingData

    @property
    def identity(self) -> list[object]:
        """What tells these data from others, whatever the table's version."""
        return [
            self.dataset_id,
            self.segmentation_id,
            len(self.training.x),
            len(self.validation.x),
        ]

    @property
    def provenance(self) -> dict[str, object]:
        """The same for people and for the tracker."""
        return {
            "dataset_id": self.dataset_id,
            "segmentation_id": self.segmentation_id,
            "segments_version": self.version,
            "training_rows": len(self.training.x),
            "validation_rows": len(self.validation.x),
        }


def learning_data(
    config: Configuration, workspace: Workspace, dataset_id: str, version: int | None = None
) -> LearningData:
    """Read the segments that the configuration means.

    Raises:
        DataError: The data set has not been cut this way, or a split is empty.
    """
    lake = workspace.lake
    version = lake.version("segments") if version is None else version
    table = lake.read(
        "segments",
        ["split", "x", "tau"],
        where=selection(dataset_id, config.segmentation_id),
        order_by="solution_index, epoch_s, goal_time_s",
        version=version,
    )
    if table.num_rows == 0:
        raise DataError(
            f"data set {dataset_id!r} has no segments of these settings (cut "
            f"{config.segmentation_id}); run `lmtr segment` with the same configuration first"
        )
    x, tau = _matrix(table["x"]), _matrix(table["tau"])
    held_out = np.array(table["split"].to_pylist()) == "validation"
    training = TrainingData(x[~held_out], tau[~held_out])
    if config.training.mirror:
        training = TrainingData(
            np.concatenate([training.x, mirror_task(training.x)]),
            np.concatenate([training.tau, mirror_segment(training.tau)]),
        )
    return LearningData(
        dataset_id,
        config.segmentation_id,
        version,
        training,
        TrainingData(x[held_out], tau[held_out]),
    )


def _matrix(column: pa.ChunkedArray) -> Array:
    values = column.combine_chunks().flatten().to_numpy(zero_copy_only=False)
    return np.asarray(values, dtype=np.float64).reshape(len(column), -1)
