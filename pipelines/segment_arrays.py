"""Segments of the lake as arrays, gathered in one pass over the files."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from deltalake import DeltaTable
from numpy.typing import NDArray

from lmtr.errors import DataError
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT, Layout
from services.lake.tables import Lake

ORDER = ("solution_index", "epoch_s", "goal_time_s")
"""Columns that order the segments of one cut of a data set, the first one first."""


@dataclass(frozen=True)
class Cut:
    """The segments that are meant.

    Attributes:
        dataset_id: The data set.
        segmentation_id: How it was cut.
        version: Version of the table ``segments``.
        split: ``train`` or ``validation``; both if None.
    """

    dataset_id: str
    segmentation_id: str
    version: int
    split: str | None = None

    @property
    def rows(self) -> pc.Expression:
        """The same for a scan of the table."""
        chosen = (pc.field("dataset_id") == self.dataset_id) & (
            pc.field("segmentation_id") == self.segmentation_id
        )
        return chosen if self.split is None else chosen & (pc.field("split") == self.split)


Real = TypeVar("Real", np.float32, np.float64)


@dataclass(frozen=True)
class SegmentArrays(Generic[Real]):
    """Segments in the order of :data:`ORDER`, row by row.

    Attributes:
        x: Tasks (N, 35), _S.
        tau: Segments (N, 264), _S.
        held_out: Which are of the validation split (N,).
        solution_index: Solution that each was cut from (N,).
        epoch_s: Time in its solution at which each begins (N,), s.
        goal_time_s: Time in its solution of each one's goal (N,), s.
    """

    x: NDArray[Real]
    tau: NDArray[Real]
    held_out: NDArray[np.bool_]
    solution_index: NDArray[np.int64]
    epoch_s: NDArray[np.float64]
    goal_time_s: NDArray[np.float64]


def segment_arrays(lake: Lake, cut: Cut, dtype: type[Real]) -> SegmentArrays[Real]:
    """Read segments in their order.

    The keys are read first, and tell where each row goes; then every row is put there as it comes,
    so that the vectors are in memory once.

    Args:
        lake: The lake.
        cut: Which segments.
        dtype: Precision of the arrays; the lake has single precision.

    Raises:
        DataError: There are none.
    """
    opened = lake.delta("segments", cut.version)
    columns = [*ORDER, "split"]
    batches = list(lake.scan("segments", columns, cut.rows, opened))
    keys = pa.Table.from_batches(batches, batches[0].schema) if batches else None
    if keys is None or keys.num_rows == 0:
        raise DataError(
            f"data set {cut.dataset_id!r} has no segments in version {cut.version} of the table; "
            "choose a later one with --at, or run `lmtr segment`"
        )
    ordering = [keys[name].to_numpy() for name in ORDER]
    order = np.lexsort(ordering[::-1])
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    x = _empty(len(order), TASK_LAYOUT, dtype)
    tau = _empty(len(order), SEGMENT_LAYOUT, dtype)
    done = 0
    for some_x, some_tau in vector_batches(lake, cut, opened):
        rows = place[done : done + len(some_x)]
        x[rows], tau[rows] = some_x, some_tau
        done += len(some_x)
    held_out = pc.equal(keys["split"], "validation").to_numpy()[order]
    return SegmentArrays(x, tau, held_out, *(values[order] for values in ordering))


def vector_batches(
    lake: Lake, cut: Cut, opened: DeltaTable
) -> Iterator[tuple[NDArray[np.float32], NDArray[np.float32]]]:
    """(x, τ) a batch at a time, in the order of the files, on Arrow's own memory."""
    for batch in lake.scan("segments", ["x", "tau"], cut.rows, opened):
        if batch.num_rows:
            yield _matrix(batch["x"], TASK_LAYOUT), _matrix(batch["tau"], SEGMENT_LAYOUT)


def _empty(rows: int, layout: Layout, dtype: type[Real]) -> NDArray[Real]:
    """A matrix (rows, size) in memory of Arrow's, which is had at once when it was used before.

    Gigabytes that are new from the system take longer to come than to be read into.
    """
    buffer = pa.allocate_buffer(rows * layout.size * np.dtype(dtype).itemsize)
    return np.frombuffer(buffer, dtype).reshape(rows, layout.size)


def _matrix(column: pa.Array, layout: Layout) -> NDArray[np.float32]:
    """A column of vectors as a matrix that shares its memory."""
    values: NDArray[np.float32] = column.flatten().to_numpy(zero_copy_only=True)
    return values.reshape(len(column), layout.size)
