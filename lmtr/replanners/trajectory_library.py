"""The trajectory library: the expert's own segment for the most similar task (Eq. 8)."""

from typing import Any

import numpy as np

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.models.rows import finite_rows
from lmtr.policies.distance import TaskWeights
from lmtr.policies.nearest_neighbour import ROWS_AT_ONCE, TaskIndex
from lmtr.vectors.layout import SEGMENT_LAYOUT
from lmtr.vectors.scaling import Standardiser


class TrajectoryLibraryReplanner:
    """Plans by look-up in the expert's segments, kept in single precision (about 1e-7 of a value).

    Args:
        x: Tasks (N, 35).
        tau: Their segments (N, 264).
        weights: w of the task distance.
        standardiser: Scaling of the task dimensions.

    Raises:
        DataError: Tasks or segments are of another layout, not finite, none, or not as many.
    """

    name = "library"

    def __init__(
        self,
        x: Array,
        tau: Array,
        weights: TaskWeights,
        standardiser: Standardiser,
    ) -> None:
        if len(x) != len(tau):
            raise DataError(
                f"trajectory library: tasks and segments must be as many, got {len(x)} and "
                f"{len(tau)}; pair every segment with its task"
            )
        self._weights = weights
        self._index = TaskIndex(x, weights, standardiser)
        self._tau = np.empty(np.shape(tau), dtype=np.float32)
        for start in range(0, len(tau), ROWS_AT_ONCE):
            some = slice(start, start + ROWS_AT_ONCE)
            self._tau[some] = finite_rows("library segments", tau[some], SEGMENT_LAYOUT)

    @property
    def nbytes(self) -> int:
        """Memory of tasks and segments (bytes)."""
        return self._index.nbytes + self._tau.nbytes

    def plan(self, x: Array) -> Array:
        """Segments τ (B, 264) for tasks x (B, 35), SI units, _S."""
        return self.suggest(x, 1)[:, 0]

    def suggest(self, x: Array, count: int) -> Array:
        """Segments τ (B, count, 264) of the tasks nearest to x (B, 35), nearest first."""
        _, rows = self._index.query(x, count)
        return self._tau[rows].astype(np.float64)

    def describe(self) -> dict[str, Any]:
        """Weights and size of the library."""
        weights = self._weights.model_dump()
        return {"replanner": self.name, "weights": weights, "rows": len(self._index)}
