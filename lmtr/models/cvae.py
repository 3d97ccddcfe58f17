"""The conditional variational autoencoder (Eq. 4; Sec. 4.3), on standardised tasks and segments.

With n = 0 latent dimensions the encoder is absent, the modes are empty, and what remains is the
unimodal regressor f: x → τ.
"""

from dataclasses import dataclass

import torch
from torch import Generator, Tensor, nn

from lmtr.models.networks import fully_connected
from lmtr.models.settings import ModelSettings


@dataclass(frozen=True)
class Reconstruction:
    """What became of a batch on its way through the CVAE.

    Attributes:
        tau_hat: Reconstructed segments, (B, 264).
        mu: Means μ_z of the modes, (B, n).
        log_variance: log σ_z², (B, n).
    """

    tau_hat: Tensor
    mu: Tensor
    log_variance: Tensor


class CVAE(nn.Module):
    """Encoder q_θ: (τ; x) → (μ_z, σ_z) and decoder p_ϕ: (z; x) → τ̂ (Eq. 4).

    Args:
        task_size: dim(x).
        segment_size: dim(τ).
        settings: Latent size, hidden layers and activation.
    """

    def __init__(self, task_size: int, segment_size: int, settings: ModelSettings) -> None:
        super().__init__()
        n, hidden = settings.latent, settings.hidden
        self.latent = n
        self.decoder = fully_connected((n + task_size, *hidden, segment_size), settings.activation)
        self.encoder: nn.Sequential | None = None
        if n:
            sizes = (segment_size + task_size, *reversed(hidden), 2 * n)
            self.encoder = fully_connected(sizes, settings.activation)

    def encode(self, tau: Tensor, x: Tensor) -> tuple[Tensor, Tensor]:
        """μ_z and log σ_z², both (B, n), of segments τ (B, 264) that solve tasks x (B, 35)."""
        if self.encoder is None:
            empty = x.new_zeros(len(x), 0)  # (B, 0)
            return empty, empty
        moments = self.encoder(torch.cat([tau, x], dim=-1))  # (B, 264 + 35) → (B, 2n)
        mu, log_variance = moments.chunk(2, dim=-1)  # 2 × (B, n)
        return mu, log_variance

    def decode(self, z: Tensor, x: Tensor) -> Tensor:
        """τ̂ (B, 264) that solves tasks x (B, 35) in modes z (B, n)."""
        tau_hat: Tensor = self.decoder(torch.cat([z, x], dim=-1))  # (B, n + 35) → (B, 264)
        return tau_hat

    def forward(self, tau: Tensor, x: Tensor, noise: Generator) -> Reconstruction:
        """Encode, draw z ~ N(μ_z, diag σ_z²) and decode."""
        mu, log_variance = self.encode(tau, x)
        z = mu + (0.5 * log_variance).exp() * normal_like(mu, noise)  # (B, n)
        return Reconstruction(self.decode(z, x), mu, log_variance)


def normal_like(like: Tensor, noise: Generator) -> Tensor:
    """Standard normal numbers in the shape and on the device of ``like``."""
    return torch.randn(like.shape, generator=noise, device=like.device, dtype=like.dtype)
