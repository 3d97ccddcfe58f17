"""The expert's choices of mode: the set D_z = {x, z} (Sec. 3.2)."""

from dataclasses import dataclass

import numpy as np

from lmtr.arrays import Array
from lmtr.models.trained import TrainedModel


@dataclass(frozen=True)
class ModeLibrary:
    """Tasks and the modes in which the expert solved them, in double or single precision.

    Attributes:
        x: Tasks (N, 35), SI units, _S.
        z: Modes (N, n).
    """

    x: Array
    z: Array


def mode_library(
    model: TrainedModel, x: Array, tau: Array, rng: np.random.Generator | None = None
) -> ModeLibrary:
    """Encode expert segments into D_z.

    Args:
        model: The trained CVAE.
        x: Tasks (N, 35).
        tau: The expert's segments (N, 264).
        rng: Draws z ~ N(μ_z, diag σ_z²) as in training; without it z is the mean μ_z, from which
            the decoder reproduces the segment best.

    Raises:
        DataError: Tasks or segments of another layout, not finite, or not as many.
    """
    mu, sigma = model.encode(tau, x)
    if rng is None:
        return ModeLibrary(x, mu)
    return ModeLibrary(x, mu + sigma * rng.standard_normal(mu.shape))
