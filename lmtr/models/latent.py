"""Which dimensions of the latent space are in use (Sec. 4.3)."""

import numpy as np

from lmtr.arrays import Array, Flags

ACTIVE_VARIANCE = 0.01
"""A dimension of z is active when its mean μ varies over the data by more than this; the prior's
variance is 1, and a dimension that the KL term has switched off has a μ near 0 everywhere."""


def active_dimensions(mu: Array) -> Flags:
    """Which dimensions of z the model uses, (n,), by the variance of μ (B, n) over the data."""
    return np.asarray(mu.var(axis=0) > ACTIVE_VARIANCE)
