"""The expert's choices of mode: the set D_z = {x, z} (Sec. 3.2)."""

from dataclasses import dataclass

import numpy as np

from lmtr.arrays import Array
from lmtr.models.trained import TrainedModel

CHUNK = 4096
"""Rows encoded at once, to bound memory."""


@dataclass(frozen=True)
class ModeLibrary:
    """Tasks and the modes in which the expert solved them.

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
    chunks = max(1, -(-len(x) // CHUNK))
    moments = [
        model.encode(taus, tasks)
        for taus, tasks in zip(np.array_split(tau, chunks), np.array_split(x, chunks), strict=True)
    ]
    mu = np.concatenate([mean for mean, _ in moments])
    if rng is None:
        return ModeLibrary(x, mu)
    sigma = np.concatenate([deviation for _, deviation in moments])
    return ModeLibrary(x, mu + sigma * rng.standard_normal(mu.shape))
