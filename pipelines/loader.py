"""Segments of a home as PyTorch tensors, for training scripts of one's own (docs/data.md).

from pathlib import Path
from pipelines.loader import load_segments

data = load_segments(Path("lmtr-home"), split="train")
for batch in data.batches(512, torch.Generator().manual_seed(0)):
    ...  # batch.x (512, 35), batch.tau (512, 264)
data.cut.version, data.solution_index  # what to note beside a model, and where each row is from
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lmtr.models.tensors import SegmentTensors
from pipelines.config import Configuration
from pipelines.datasets import resolve
from pipelines.learning_data import resolve_cut
from pipelines.segment_arrays import Cut, segment_arrays, vector_batches
from pipelines.workspace import Workspace

Split = Literal["train", "validation"]


@dataclass(frozen=True, kw_only=True)
class Segments(SegmentTensors):
    """Segments of a home, and where each is from; the same ``cut`` gives the same rows for good.

    Attributes:
        cut: Data set, segmentation, version of the table and split.
        solution_index: Solution that each was cut from (N,).
        epoch_s: Time in its solution at which each begins (N,), s.
        goal_time_s: Time in its solution of each one's goal (N,), s.
    """

    cut: Cut
    solution_index: NDArray[np.int64]
    epoch_s: NDArray[np.float64]
    goal_time_s: NDArray[np.float64]


def load_segments(
    home: Path,
    dataset: str | None = None,
    *,
    split: Split | None = None,
    version: int | None = None,
    segmentation: str | None = None,
) -> Segments:
    """All segments at once, ordered by solution and epoch: each number is copied once.

    Args:
        home: The home.
        dataset: Id of the data set; the newest by default.
        split: ``train`` or ``validation``; both by default.
        version: Version of the table ``segments``; the present one by default.
        segmentation: How it was cut; need be named only if it was cut in several ways.

    Raises:
        DataError: There are no such segments.
        LakeError: The table or the version is missing.
    """
    space = Workspace.open(home, create=False)
    cut = _cut(space, dataset, split, version, segmentation)
    found = segment_arrays(space.lake, cut, np.float32)
    pairs = SegmentTensors.sharing(found.x, found.tau)
    return Segments(
        pairs.x,
        pairs.tau,
        cut=cut,
        solution_index=found.solution_index,
        epoch_s=found.epoch_s,
        goal_time_s=found.goal_time_s,
    )


def stream_segments(
    home: Path,
    dataset: str | None = None,
    *,
    split: Split | None = None,
    version: int | None = None,
    segmentation: str | None = None,
) -> Iterator[SegmentTensors]:
    """The same a few thousand rows at a time, for data sets that are larger than the memory.

    Rows come in the order of the files. Tensors lie on Arrow's own memory, nothing is copied: they
    may be read, and must be cloned before anything is written to them.
    """
    space = Workspace.open(home, create=False)
    cut = _cut(space, dataset, split, version, segmentation)
    for x, tau in vector_batches(space.lake, cut, space.lake.delta("segments", cut.version)):
        yield SegmentTensors.sharing(x, tau)


def _cut(
    space: Workspace,
    dataset: str | None,
    split: Split | None,
    version: int | None,
    segmentation: str | None,
) -> Cut:
    dataset_id = resolve(space, dataset)
    return Cut(
        dataset_id,
        segmentation or resolve_cut(Configuration(), space, dataset_id),
        space.lake.version("segments") if version is None else version,
        split,
    )
