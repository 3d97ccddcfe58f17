"""The training loss of the CVAE (Eq. 5)."""

from dataclasses import dataclass, replace
from typing import Literal

import torch
from torch import Tensor


@dataclass(frozen=True)
class Loss:
    """Eq. 5 and its two parts, as means over a batch; scalars.

    Attributes:
        total: ℒ, the reconstruction error plus κ times the divergence, and what else is minimised.
        reconstruction: L1 error of the standardised τ, by mean or sum over its dimensions.
        kl: Divergence of the encoder's modes from the prior (nats), summed over dimensions.
    """

    total: Tensor
    reconstruction: Tensor
    kl: Tensor

    def plus(self, weight: float, error: Tensor) -> "Loss":
        """With another error (scalar) in the total."""
        return replace(self, total=torch.add(self.total, error, alpha=weight))


def gaussian_kl(mu: Tensor, log_variance: Tensor) -> Tensor:
    """D_KL(N(μ, diag σ²) ‖ N(0, I)) of each row, (B,) in nats; 0 where there is no latent."""
    return 0.5 * (mu**2 + log_variance.exp() - 1.0 - log_variance).sum(dim=-1)


def cvae_loss(
    tau: Tensor,
    tau_hat: Tensor,
    mu: Tensor,
    log_variance: Tensor,
    kappa: float,
    reduction: Literal["mean", "sum"],
    weights: Tensor | None = None,
) -> Loss:
    """Eq. 5 on one batch.

    Args:
        tau: Standardised segments, (B, 264).
        tau_hat: Their reconstructions, (B, 264).
        mu: Encoder's means, (B, n).
        log_variance: Encoder's log σ², (B, n).
        kappa: κ.
        reduction: Over the dimensions of τ; it decides, with the scaling of τ, what κ means.
        weights: How much each dimension of τ counts, (264,); all alike by default.
    """
    error = (tau - tau_hat).abs()  # (B, 264)
    if weights is not None:
        error = error * weights
    per_segment = error.mean(dim=-1) if reduction == "mean" else error.sum(dim=-1)  # (B,)
    reconstruction, kl = per_segment.mean(), gaussian_kl(mu, log_variance).mean()
    return Loss(torch.add(reconstruction, kl, alpha=kappa), reconstruction, kl)
