"""Training data: pairs of task and segment, checked before they are used."""

from dataclasses import dataclass
from typing import Self

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.models.rows import finite_rows
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT


@dataclass(frozen=True)
class TrainingData:
    """Pairs of task and segment, in SI units and _S.

    Attributes:
        x: Tasks (N, 35).
        tau: Segments (N, 264).
    """

    x: Array
    tau: Array

    def checked(self, name: str) -> Self:
        """The same data, refused if a training could not use them.

        Raises:
            DataError: None, unpaired or non-finite rows, or rows of another layout.
        """
        x = finite_rows(f"{name} tasks x", self.x, TASK_LAYOUT)
        tau = finite_rows(f"{name} segments tau", self.tau, SEGMENT_LAYOUT)
        if len(x) != len(tau):
            raise DataError(
                f"{name} data: x and tau must be as many rows, got {len(x)} and {len(tau)}; "
                "pair every segment with its task"
            )
        if len(x) == 0:
            raise DataError(
                f"{name} data: at least one row is needed, got 0; use more solutions or another "
                "share for validation"
            )
        return type(self)(x, tau)
