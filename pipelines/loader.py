"""Segments of a home as PyTorch tensors, for training scripts of one's own (docs/data.md).

from pathlib import Path
from pipelines.loader import load_segments

data = load_segments(Path("lmtr-home"), split="train")
for batch in data.batches(512, torch.Generator().manual_seed(0)):
    ...  # batch.x (512, 35), batch.tau (512, 264)
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np

from lmtr.models.tensors import SegmentTensors
from pipelines.config import Configuration
from pipelines.datasets import resolve
from pipelines.learning_data import resolve_cut
from pipelines.segment_arrays import Cut, segment_arrays, vector_batches
from pipelines.workspace import Workspace

Split = Literal["train", "validation"]


def load_segments(
    home: Path,
    dataset: str | None = None,
    *,
    split: Split | None = None,
    version: int | None = None,
    segmentation: str | None = None,
) -> SegmentTensors:
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
    arrays = segment_arrays(space.lake, cut, np.float32)
    return SegmentTensors.sharing(arrays.x, arrays.tau)


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
