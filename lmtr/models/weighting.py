"""How much each dimension of τ counts in the reconstruction error of Eq. 5.

The network always predicts standardised dimensions, which trains well whatever the units. What the
error is measured in is a choice of its own: an L1 error in another scaling is the standardised one
with a weight for each dimension.
"""

from typing import Literal

import numpy as np

from lmtr.arrays import Array
from lmtr.errors import ModelError
from lmtr.settings import NonNegative, Settings
from lmtr.vectors.layout import Layout
from lmtr.vectors.scaling import Standardiser

ErrorScale = Literal["dimension", "field", "unit"]
"""What an error is divided by, see :class:`LossWeights`."""


class LossWeights(Settings):
    """Weights of the L1 error by what a dimension is.

    Attributes:
        scale: ``dimension`` divides an error by its dimension's standard deviation; ``field`` by
            that of all dimensions of its kind and unit (say, all swing positions), so that what
            varies more counts more; ``unit`` by one SI unit, a robot's weight for forces.
        base: Factor for the base nodes.
        times: Factor for the contact changes.
        motion: Factor for footholds and swings. At five, footholds come out a third more exact than
            at one, and feet jump a third less at replanning, for a sixth more error of the base.
        forces: Factor for the force nodes.
        start: Weight of how far feet are at the epoch from where the segment starts, which is known
            (:mod:`lmtr.models.epoch_feet`), beside the error of all dimensions. At 0.3 feet jump
            half as far at replanning as without, for a tenth more error of the forces.
    """

    scale: ErrorScale = "dimension"
    base: NonNegative = 1.0
    times: NonNegative = 1.0
    motion: NonNegative = 5.0
    forces: NonNegative = 1.0
    start: NonNegative = 0.3

    def of(self, scaling: Standardiser, weight: float) -> Array:
        """Weight of each standardised dimension's error, (264,), one in the mean.

        So κ weighs the same against this error whatever is chosen here; ``start`` comes on top.

        Args:
            scaling: Standardisation of τ.
            weight: The robot's weight (N).

        Raises:
            ModelError: Nothing is weighed that varies at all.
        """
        factors = np.concatenate(
            [np.full(size, getattr(self, group)) for group, size in _sizes(scaling.layout)]
        )
        weights = np.asarray(factors * self._scales(scaling, weight))
        if weights.sum() <= 0.0:
            raise ModelError(
                "loss weights: no dimension that varies in the data counts; raise training.model."
                "loss_weights"
            )
        return np.asarray(weights * (len(weights) / weights.sum()))

    def _scales(self, scaling: Standardiser, weight: float) -> Array:
        """Standard deviations over what errors are divided by; ones by dimension."""
        if self.scale == "dimension":
            return np.ones(scaling.layout.size)
        if self.scale == "unit":
            forces = np.concatenate(
                [np.full(size, group == "forces") for group, size in _sizes(scaling.layout)]
            )
            return np.asarray(scaling.scale / np.where(forces, weight, 1.0))
        kinds = _kinds(scaling.layout)
        pooled = np.zeros(scaling.layout.size)
        for kind in np.unique(kinds):
            mine = kinds == kind
            pooled[mine] = np.sqrt((scaling.scale[mine] ** 2).mean())
        return np.asarray(scaling.scale / np.where(pooled > 0.0, pooled, 1.0))


def _sizes(layout: Layout) -> list[tuple[str, int]]:
    """Category and size of each field, in their order."""
    return [(field.category, field.size) for field in layout.fields]


def _kinds(layout: Layout) -> Array:
    """Number of the kind of each dimension: quantities of one unit, of all nodes and feet alike."""
    numbers: dict[tuple[str, int], int] = {}
    kinds = []
    for field in layout.fields:
        name = field.name if field.category == "base" else field.name.split("_", 1)[1]
        places = np.arange(field.size)
        # Nodes hold a value and its derivative; the base's are positions and then angles.
        if field.name == "base_nodes":
            part = places % 12 // 3
        elif field.category == "forces":
            part = places % 6 // 3
        else:
            part = np.zeros_like(places)
        kinds += [numbers.setdefault((name, int(k)), len(numbers)) for k in part]
    return np.array(kinds)
