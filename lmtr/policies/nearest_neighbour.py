"""Exact nearest neighbours among tasks, the argmin of Eqs. 7 and 8.

A flat search beats trees at this size and dimension: about 0.1 ms for 25,000 tasks. Both sides
are scaled beforehand so that the weighted norm becomes a plain L1 norm, in single precision; the
few candidates that come back are then measured again in double precision and ordered by
(distance, row), because ties are common: segments of one epoch differ in their goals alone, and
with γ at weight 0 they are equally near.
"""

import faiss
import numpy as np
from numpy.typing import NDArray

from lmtr.arrays import Array, Flags
from lmtr.errors import DataError
from lmtr.models.rows import finite_rows
from lmtr.policies.distance import TaskWeights
from lmtr.vectors.scaling import Standardiser

Rows = NDArray[np.int64]
"""Rows of the library, as FAISS counts them."""

SPARE = 8
"""Candidates beyond the k asked for, to see whether the k-th is tied."""

LANES = 8
"""The search takes so many dimensions at a time; a row padded to a multiple of it with zeros is
found up to 30 % faster than one with a remainder."""

ROUNDING = float(np.finfo(np.float32).eps)


class TaskIndex:
    """The tasks of a library, to be searched by :class:`TaskWeights`.

    Args:
        x: Tasks (N, 35), N ≥ 1.
        weights: Weight of each category.
        standardiser: Scaling of the task dimensions.

    Raises:
        DataError: There are no tasks, they are of another layout than the standardiser, or
            nothing that varies has a weight.
    """

    def __init__(self, x: Array, weights: TaskWeights, standardiser: Standardiser) -> None:
        self._layout = standardiser.layout
        x = finite_rows("library tasks", x, self._layout)
        if len(x) == 0:
            raise DataError("library tasks: at least one is needed to have a nearest, got 0")
        w = weights.expanded(self._layout)
        # Dimensions that weigh nothing or never vary need not be searched.
        self._used = np.flatnonzero((w > 0.0) & ~standardiser.constant)
        if len(self._used) == 0:
            raise DataError(
                f"task index: weights {weights.values} leave only dimensions that are constant in "
                "the data, so every task is equally near; weigh another category"
            )
        self._scale = w[self._used] / standardiser.scale[self._used]
        self._centre = standardiser.mean[self._used]
        rows = self._scaled(x)
        self._largest_norm = float(np.abs(rows).sum(axis=1).max())
        self._index = faiss.IndexFlat(rows.shape[1], faiss.METRIC_L1)
        self._index.add(rows)

    def __len__(self) -> int:
        return int(self._index.ntotal)

    @property
    def nbytes(self) -> int:
        """Memory of the scaled tasks (bytes)."""
        return len(self) * int(self._index.d) * np.dtype(np.float32).itemsize

    def query(self, x: Array, k: int = 1) -> tuple[Array, Rows]:
        """The k nearest library tasks of each task, nearest first, ties by lower row.

        Args:
            x: Tasks (B, 35).
            k: Neighbours, 1 ≤ k ≤ N.

        Returns:
            Distances d and rows of the library, both (B, k).

        Raises:
            DataError: Tasks of another width or not finite, or k out of range.
        """
        x = finite_rows("tasks", x, self._layout)
        if not 1 <= k <= len(self):
            raise DataError(f"task index: k must be in 1..{len(self)} (its tasks), got {k}")
        queries = self._scaled(x)
        count = min(k + SPARE, len(self))
        reached, candidates = self._index.search(queries, count)
        distances, order = self._ranked(queries, candidates, k)
        if count < len(self):
            for row in np.flatnonzero(self._is_tied(queries, reached, k)):
                everything = np.arange(len(self))[None, :]
                one = slice(row, row + 1)
                distances[one], order[one] = self._ranked(queries[one], everything, k)
        return distances, order

    def _scaled(self, x: Array) -> NDArray[np.float32]:
        scaled = np.zeros((len(x), -(-len(self._used) // LANES) * LANES), dtype=np.float32)
        scaled[:, : len(self._used)] = (x[:, self._used] - self._centre) * self._scale
        return scaled

    def _is_tied(self, queries: NDArray[np.float32], reached: NDArray[np.float32], k: int) -> Flags:
        """Whether tasks beyond the candidates may be as near as the k-th, up to rounding."""
        norms = np.abs(queries).sum(axis=1) + self._largest_norm
        slack = ROUNDING * (norms + queries.shape[1] * reached[:, -1])
        return np.asarray(reached[:, -1] - reached[:, k - 1] <= slack)

    def _ranked(self, queries: NDArray[np.float32], candidates: Rows, k: int) -> tuple[Array, Rows]:
        """The k nearest of the candidates (B, C) in double precision, ties by lower row."""
        rows = self._index.reconstruct_batch(candidates.reshape(-1))
        rows = rows.reshape(*candidates.shape, queries.shape[1]).astype(np.float64)
        distances = np.abs(rows - queries[:, None, :]).sum(axis=-1)
        order = np.lexsort((candidates, distances), axis=-1)[:, :k]
        return (
            np.take_along_axis(distances, order, axis=-1),
            np.take_along_axis(candidates, order, axis=-1),
        )
