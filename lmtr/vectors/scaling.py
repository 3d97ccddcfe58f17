"""Standardisation of task and segment vectors, one dimension at a time.

Scaling, loss and its weight κ are one contract (Eq. 5): κ = 0.001 means little without the scaling
that it was chosen for, so a model stores its :class:`Standardiser`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from lmtr.arrays import Array, Flags
from lmtr.errors import DataError
from lmtr.vectors.layout import Layout

FLOOR = 1e-4
"""A dimension that spreads less (m, rad, s, N, …) is constant: that is the solver's tolerance."""


@dataclass(frozen=True)
class Standardiser:
    """Zero mean and unit standard deviation per dimension.

    Attributes:
        layout: Layout of the vectors.
        mean: (size,).
        scale: Standard deviation, (size,); 0 marks a constant dimension, which is scaled to 0 and
            always comes back as its mean, whatever a network predicts for it.
    """

    layout: Layout
    mean: Array
    scale: Array

    def __post_init__(self) -> None:
        for name in ("mean", "scale"):
            shape = np.shape(getattr(self, name))
            if shape != (self.layout.size,):
                raise DataError(
                    f"standardiser: {name} must have shape ({self.layout.size},) for layout "
                    f"{self.layout}, got {shape}"
                )
        if not (np.isfinite(self.mean).all() and (np.asarray(self.scale) >= 0.0).all()):
            raise DataError(
                "standardiser: mean must be finite and scale at least 0 in every dimension; "
                "fit it again"
            )

    @classmethod
    def fit(cls, layout: Layout, vectors: Array, floor: float = FLOOR) -> Self:
        """Mean and standard deviation of vectors (n, size).

        Args:
            layout: Layout of the vectors.
            vectors: The training rows, n ≥ 2.
            floor: Dimensions of a smaller standard deviation count as constant.

        Raises:
            DataError: Too few rows, another size, or numbers that are not finite.
        """
        rows = layout.require_finite(vectors).reshape(-1, layout.size).astype(np.float64)
        if len(rows) < 2:
            raise DataError(f"standardiser: fit needs at least 2 vectors, got {len(rows)}")
        mean, scale = rows.mean(axis=0), rows.std(axis=0)
        constant = scale < floor
        # The mean of equal numbers may differ from them in the last digit; the median does not.
        mean[constant] = np.median(rows[:, constant], axis=0)
        return cls(layout, mean, np.where(constant, 0.0, scale))

    @property
    def constant(self) -> Flags:
        """Which dimensions are constant, (size,)."""
        return np.asarray(self.scale == 0.0)

    def apply(self, vectors: Array) -> Array:
        """Standardised vectors (..., size).

        Raises:
            DataError: Numbers that are not finite, naming their field.
        """
        centred = self.layout.require_finite(vectors) - self.mean
        return np.where(self.constant, 0.0, centred / np.where(self.constant, 1.0, self.scale))

    def invert(self, scaled: Array) -> Array:
        """Vectors (..., size) in SI units from standardised ones."""
        return np.asarray(self.layout.require_size(scaled) * self.scale + self.mean)

    def to_dict(self) -> dict[str, Array]:
        """Mean and scale, to be stored beside the layout's metadata."""
        return {"mean": np.array(self.mean), "scale": np.array(self.scale)}

    @classmethod
    def from_dict(cls, layout: Layout, arrays: Mapping[str, Array]) -> Self:
        """The standardiser that :meth:`to_dict` stored."""
        if set(arrays) != {"mean", "scale"}:
            raise DataError(f"standardiser: needs arrays mean and scale, got {sorted(arrays)}")
        return cls(layout, np.asarray(arrays["mean"]), np.asarray(arrays["scale"]))
