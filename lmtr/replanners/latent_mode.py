"""Latent-mode trajectory regression, τ = f_z(x, π(x)) (Eq. 6)."""

from typing import Any

import numpy as np

from lmtr.arrays import Array
from lmtr.errors import ModelError
from lmtr.models.trained import TrainedModel
from lmtr.policies.mode_policy import ModePolicy, NearestModePolicy


class LatentModeReplanner:
    """Plans with the CVAE's decoder in the mode that a policy selects.

    Args:
        model: A trained model with n ≥ 1.
        policy: π, for the same latent space.

    Raises:
        ModelError: The model has no latent space, or the policy one of another size.
    """

    def __init__(self, model: TrainedModel, policy: ModePolicy) -> None:
        if model.latent == 0 or policy.latent != model.latent:
            raise ModelError(
                f"latent-mode replanner: model {model.settings.name} has {model.latent} latent "
                f"dimensions and its policy selects {policy.latent}; both must be the same and at "
                "least 1"
            )
        self._model, self._policy = model, policy

    @property
    def name(self) -> str:
        """LMTR-n, with the policy in brackets unless it is the paper's."""
        model, policy = self._model.settings.name, self._policy.name
        return model if policy == "nearest" else f"{model} ({policy})"

    @property
    def nbytes(self) -> int:
        """Memory of decoder and policy (bytes)."""
        return self._model.nbytes + self._policy.nbytes

    def plan(self, x: Array) -> Array:
        """Segments τ (B, 264) for tasks x (B, 35), SI units, _S."""
        return self._model.predict(x, self._policy.select(x))

    def suggest(self, x: Array, count: int) -> Array:
        """Segments τ (B, count, 264) in the modes of the tasks nearest to x (B, 35).

        Raises:
            ModelError: The policy has one mode for a task.
        """
        if not isinstance(self._policy, NearestModePolicy):
            raise ModelError(
                f"latent-mode replanner: policy {self._policy.name!r} has one mode for a task; "
                "select among those of the nearest tasks"
            )
        modes = self._policy.suggest(x, count)
        plans = self._model.predict(
            np.repeat(x, count, axis=0), modes.reshape(len(x) * count, self._model.latent)
        )
        return plans.reshape(len(x), count, plans.shape[-1])

    def describe(self) -> dict[str, Any]:
        """Settings and origin of model and policy."""
        return {"replanner": self.name, **self._model.describe(), **self._policy.describe()}
