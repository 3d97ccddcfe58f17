"""The distance between tasks: a weighted L1 norm (Sec. 3.3).

d(x, x′) = Σᵢ wᵢ·|x̂ᵢ − x̂′ᵢ| over standardised task dimensions, with one weight per category of
the task, so that the paper's coarse 4D grid over w (Sec. 4.3) is a grid over :class:`TaskWeights`.

Angles need no care of their own here. The goal's heading enters as (cos ψ, sin ψ). A line's
direction α ∈ [0, π) has its seam where the line runs along the robot; lines to be crossed are
within about a radian of square to it, α ≈ π/2, and the regressor sees the same seam.
"""

from collections.abc import Sequence
from typing import Self

import numpy as np
from pydantic import model_validator

from lmtr.arrays import Array
from lmtr.errors import ConfigurationError
from lmtr.settings import NonNegative, Settings
from lmtr.vectors.layout import TASK_LAYOUT, Layout


class TaskWeights(Settings):
    """Weight of each category of the task, per standardised dimension.

    Attributes:
        chi_base: State of the base.
        chi_feet: State of the feet.
        eta: Obstacles; favouring them keeps footholds away from lines (Fig. 4c).
        gamma: Goal.
    """

    chi_base: NonNegative = 1.0
    chi_feet: NonNegative = 1.0
    eta: NonNegative = 1.0
    gamma: NonNegative = 1.0

    @model_validator(mode="after")
    def _tells_tasks_apart(self) -> Self:
        if not any(self.values):
            raise ValueError(
                "task weights must not all be 0, or every task is equally near; "
                "raise at least one of chi_base, chi_feet, eta, gamma"
            )
        return self

    @classmethod
    def of(cls, values: Sequence[float]) -> Self:
        """Weights from four numbers, in the order χ_base, χ_feet, η, γ.

        Raises:
            ConfigurationError: There are not four of them.
        """
        names = tuple(cls.model_fields)
        if len(values) != len(names):
            raise ConfigurationError(
                f"task weights must be {len(names)} numbers ({', '.join(names)}), "
                f"got {len(values)}: {list(values)}"
            )
        return cls(**dict(zip(names, values, strict=True)))

    @property
    def values(self) -> tuple[float, float, float, float]:
        """The weights in the order χ_base, χ_feet, η, γ."""
        return self.chi_base, self.chi_feet, self.eta, self.gamma

    def expanded(self, layout: Layout = TASK_LAYOUT) -> Array:
        """w, one weight per task dimension, (35,)."""
        weights = np.zeros(layout.size)
        for category, part in layout.category_indices().items():
            weights[part] = getattr(self, category)
        return weights
