"""π_N, the unimodal Gaussian over modes (Sec. 3.3; the paper's reference [23])."""

from typing import Any

import numpy as np

from lmtr.arrays import Array
from lmtr.models.perceptron import Perceptron
from lmtr.models.rows import finite_rows
from lmtr.models.trained import standardising
from lmtr.vectors.scaling import Standardiser


class GaussianModePolicy:
    """Selects the likeliest mode μ_z(x) of the Gaussian.

    Args:
        network: From standardised tasks (B, 35) to (μ_z, log σ_z²), (B, 2n).
        standardiser: Scaling of the task dimensions.

    Attributes:
        network: As given.
    """

    name = "gaussian"

    def __init__(self, network: Perceptron, standardiser: Standardiser) -> None:
        self.network = network
        self._network = network.after(standardising(standardiser))
        self._layout = standardiser.layout

    @property
    def latent(self) -> int:
        """N."""
        return len(self._network.biases[-1]) // 2

    @property
    def hidden(self) -> list[int]:
        """Sizes of its hidden layers."""
        return [weight.shape[1] for weight in self.network.weights[:-1]]

    @property
    def nbytes(self) -> int:
        """Memory of the network (bytes)."""
        return self._network.nbytes

    def moments(self, x: Array) -> tuple[Array, Array]:
        """μ_z and σ_z, both (B, n), for tasks x (B, 35)."""
        mu, log_variance = np.split(self._network(finite_rows("tasks", x, self._layout)), 2, axis=1)
        return mu, np.exp(0.5 * log_variance)

    def select(self, x: Array) -> Array:
        """μ_z (B, n) for tasks x (B, 35)."""
        return self.moments(x)[0]

    def describe(self) -> dict[str, Any]:
        """Its layers."""
        return {"policy": self.name, "hidden": self.hidden}
