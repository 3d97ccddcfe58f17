"""Segments as tensors, for training by whatever code one likes."""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Generator, Tensor

from lmtr.errors import DataError
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT, Layout


@dataclass(frozen=True)
class SegmentTensors:
    """Pairs of task and segment, in SI units and _S.

    Attributes:
        x: Tasks (N, 35), single precision.
        tau: Segments (N, 264), single precision.
        task_layout: Where each quantity lies in x.
        segment_layout: Where each quantity lies in τ.
    """

    x: Tensor
    tau: Tensor
    task_layout: Layout = TASK_LAYOUT
    segment_layout: Layout = SEGMENT_LAYOUT

    @classmethod
    def sharing(cls, x: NDArray[np.float32], tau: NDArray[np.float32]) -> "SegmentTensors":
        """Tensors on the memory of arrays (N, 35) and (N, 264): nothing is copied.

        Memory that is not ours to change, such as Arrow's, may be read only: copy it first
        (``tensor.clone()``) if it is to be written to.

        Raises:
            DataError: The arrays are not as many rows.
        """
        if len(x) != len(tau):
            raise DataError(
                f"tensors: x and tau must be as many rows, got {len(x)} and {len(tau)}; pair every "
                "segment with its task"
            )
        with warnings.catch_warnings():
            # Torch has no tensors that are read-only, and says so.
            warnings.filterwarnings("ignore", "The given NumPy array is not writable")
            return cls(torch.from_numpy(x), torch.from_numpy(tau))

    def __len__(self) -> int:
        return len(self.x)

    def __getitem__(self, rows: slice | Tensor) -> "SegmentTensors":
        """Some of the pairs; a slice shares their memory."""
        return SegmentTensors(self.x[rows], self.tau[rows])

    def batches(self, size: int, generator: Generator | None = None) -> Iterator["SegmentTensors"]:
        """All pairs once, ``size`` at a time; the last batch may be smaller.

        Args:
            size: Rows of a batch.
            generator: Draws the order; without one the order is that of the rows, and batches
                share their memory.
        """
        if generator is None:
            for start in range(0, len(self), size):
                yield self[start : start + size]
            return
        for rows in torch.split(torch.randperm(len(self), generator=generator), size):
            yield self[rows]
