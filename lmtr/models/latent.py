"""What the latent space is used for: divergence per dimension and active dimensions (Sec. 4.3)."""

import numpy as np

from lmtr.arrays import Array, Flags

ACTIVE_VARIANCE = 0.01
"""A dimension of z is active when its mean μ varies over the data by more than this; the prior's
variance is 1, and a dimension that the KL term has switched off has a μ near 0 everywhere."""


def kl_per_dimension(mu: Array, sigma: Array) -> Array:
    """Mean divergence D_KL(N(μ, σ²) ‖ N(0, 1)) of each dimension over the data, (n,) in nats.

    Args:
        mu: Means of the encoder, (B, n).
        sigma: Its standard deviations, (B, n).
    """
    divergence = 0.5 * (mu**2 + sigma**2 - 1.0) - np.log(sigma)
    return np.asarray(divergence.mean(axis=0))


def active_dimensions(mu: Array) -> Flags:
    """Which dimensions of z the model uses, (n,), by the variance of μ (B, n) over the data."""
    return np.asarray(mu.var(axis=0) > ACTIVE_VARIANCE)
