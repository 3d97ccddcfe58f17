"""Registered replanners as MLflow loads them: ``predict`` plans, with nothing of LMTR's services.

MLflow imports this module by its name, which stands in every registered model, and calls
:func:`_load_pyfunc`.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.replanners import artifact
from lmtr.replanners.replanner import Replanner
from lmtr.vectors.layout import TASK_LAYOUT


class ServedReplanner:
    """A saved replanner behind MLflow's ``predict``."""

    def __init__(self, replanner: Replanner) -> None:
        self.replanner = replanner

    def predict(self, model_input: Array, params: Mapping[str, object] | None = None) -> Array:
        """Plans τ (B, 264) of tasks x (B, 35), SI units, frame S.

        Raises:
            DataError: The tasks have another shape.
        """
        x = np.asarray(model_input, dtype=np.float64)
        if x.ndim != 2 or x.shape[1] != TASK_LAYOUT.size:
            raise DataError(
                f"tasks: must be (B, {TASK_LAYOUT.size}), got {x.shape}; give x in rows"
            )
        return np.asarray(self.replanner.plan(x), dtype=np.float64)


def _load_pyfunc(path: str) -> ServedReplanner:
    """MLflow's: the replanner in a registered model's data folder."""
    return ServedReplanner(artifact.load(Path(path)))
