"""Segments from the lake as arrays: what models are trained on and libraries are made of."""

from dataclasses import dataclass

import numpy as np

from lmtr.arrays import Indices
from lmtr.errors import DataError
from lmtr.models.data import TrainingData
from lmtr.streams import Purpose, stream
from lmtr.vectors.mirror import mirror_segment, mirror_task
from pipelines.config import Configuration
from pipelines.segment_arrays import Cut, segment_arrays
from pipelines.workspace import Workspace


@dataclass(frozen=True)
class LearningData:
    """One data set, cut one way and split by solution.

    Attributes:
        dataset_id: The data set.
        segmentation_id: How it was cut.
        version: Version of the table ``segments`` that was read.
        training: Pairs (x, τ) to learn from, with their mirror images where asked for.
        validation: Pairs held out.
        mirrored: Whether half of the training pairs are the mirror images of the others.
    """

    dataset_id: str
    segmentation_id: str
    version: int
    training: TrainingData
    validation: TrainingData
    mirrored: bool = False

    @property
    def identity(self) -> list[object]:
        """What tells these data from others, whatever the table's version."""
        return [
            self.dataset_id,
            self.segmentation_id,
            len(self.training.x),
            len(self.validation.x),
            self.mirrored,
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
            "mirrored": self.mirrored,
        }


def resolve_cut(config: Configuration, workspace: Workspace, dataset_id: str) -> str:
    """The configuration's own cut of a data set if it is there, else the only one there is.

    Raises:
        DataError: The data set has not been cut, or in several other ways.
    """
    known = workspace.lake.values("cuts", "segmentation_id", f"dataset_id = '{dataset_id}'")
    if config.segmentation_id in known:
        return config.segmentation_id
    if not known:
        raise DataError(f"data set {dataset_id!r} has no segments; run `lmtr segment` first")
    if len(known) > 1:
        raise DataError(
            f"data set {dataset_id!r} was cut in {len(known)} ways and not in that of these "
            "settings; name the configuration it was cut with (--config, --set segmentation.…)"
        )
    return str(known[0])


def learning_data(
    config: Configuration, workspace: Workspace, dataset_id: str, at: int | None = None
) -> LearningData:
    """Read the segments that the configuration means, see :func:`resolve_cut`.

    They are in double precision, in which scalings are fitted and motions mirrored.

    Args:
        config: How they were cut.
        workspace: The home.
        dataset_id: The data set.
        at: Version of the table ``segments``, to learn once more from what was there then; the
            present one by default.

    Raises:
        DataError: The data set has not been cut in a way that can be told, or not by then.
        LakeError: There is no such version.
    """
    lake = workspace.lake
    cut = resolve_cut(config, workspace, dataset_id)
    version = lake.version("segments") if at is None else at
    found = segment_arrays(lake, Cut(dataset_id, cut, version), np.float64)
    x, tau, held_out = found.x, found.tau, found.held_out
    rows = _drawn(np.flatnonzero(~held_out), config)
    training = TrainingData(x[rows], tau[rows])
    if config.training.mirror:
        training = TrainingData(
            np.concatenate([training.x, mirror_task(training.x)]),
            np.concatenate([training.tau, mirror_segment(training.tau)]),
        )
    return LearningData(
        dataset_id,
        cut,
        version,
        training,
        TrainingData(x[held_out], tau[held_out]),
        config.training.mirror,
    )


def _drawn(rows: Indices, config: Configuration) -> Indices:
    """Those of the training rows that are learnt from, in their order."""
    most = config.training.segments
    if most is None or most >= len(rows):
        return rows
    rng = stream(config.dataset.seed, Purpose.TRAINING_ROWS)
    return np.sort(rng.permutation(rows)[:most])
