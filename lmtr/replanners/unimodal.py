"""The unimodal regressor f: x → τ, LMTR with no latent dimension (Sec. 3.2, 4.3)."""

from typing import Any

import numpy as np

from lmtr.arrays import Array
from lmtr.errors import ModelError
from lmtr.models.trained import TrainedModel


class UnimodalReplanner:
    """Plans with a regressor that averages over the expert's modes.

    Args:
        model: A trained model with n = 0.

    Raises:
        ModelError: The model has a latent space.
    """

    name = "unimodal"

    def __init__(self, model: TrainedModel) -> None:
        if model.latent:
            raise ModelError(
                f"unimodal replanner: the model must have latent = 0, got {model.settings.name}; "
                "plan with it through a mode policy"
            )
        self._model = model

    @property
    def nbytes(self) -> int:
        """Memory of the network (bytes)."""
        return self._model.nbytes

    def plan(self, x: Array) -> Array:
        """Segments τ (B, 264) for tasks x (B, 35), SI units, _S."""
        return self._model.predict(x, np.zeros((len(x), 0)))

    def describe(self) -> dict[str, Any]:
        """The model's settings and origin."""
        return {"replanner": self.name, **self._model.describe()}
