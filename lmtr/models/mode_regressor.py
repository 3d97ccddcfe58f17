"""The unimodal Gaussian over modes of the paper's reference [23]: π_N: x → (μ_z, σ_z) (Sec. 3.3).

It is fitted to the encoder's own distributions, by the divergence D_KL(q_θ(z | τ, x) ‖ π_N(z | x))
in expectation over the data; so its mean is the mean of the modes that the expert chose in such a
task, and its variance is theirs and the encoder's together.
"""

import torch
from torch import Generator, Tensor, nn

from lmtr.models.data import TrainingData
from lmtr.models.networks import as_perceptron, fully_connected, torch_threads
from lmtr.models.perceptron import Perceptron
from lmtr.models.settings import ModeRegressorSettings
from lmtr.models.trained import TrainedModel


def fit_mode_regressor(
    model: TrainedModel, data: TrainingData, settings: ModeRegressorSettings
) -> Perceptron:
    """Fit π_N to the modes of a model's encoder.

    Args:
        model: A trained model with n ≥ 1.
        data: The expert's segments.
        settings: How it is fitted.

    Returns:
        The network from standardised tasks to (μ_z, log σ_z²), (B, 35) → (B, 2n).
    """
    with torch_threads(1):
        x = torch.as_tensor(model.task_scaling.apply(data.x), dtype=torch.float32)
        moments = model.encode(data.tau, data.x)
        mu, sigma = (torch.as_tensor(each, dtype=torch.float32) for each in moments)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(settings.seed)
            sizes = (x.shape[1], *settings.hidden, 2 * model.latent)
            network = fully_connected(sizes, model.settings.activation)
        _descend(network, x, mu, sigma, settings)
    return as_perceptron(network, model.settings.activation)


def _descend(
    network: nn.Sequential, x: Tensor, mu: Tensor, sigma: Tensor, settings: ModeRegressorSettings
) -> None:
    optimiser = torch.optim.Adam(network.parameters(), lr=settings.learning_rate)
    steps = settings.epochs * -(-len(x) // settings.batch_size)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    order = Generator().manual_seed(settings.seed)
    for _ in range(settings.epochs):
        for rows in torch.split(torch.randperm(len(x), generator=order), settings.batch_size):
            mean, log_variance = network(x[rows]).chunk(2, dim=1)
            loss = diagonal_kl(mu[rows], sigma[rows], mean, log_variance).mean()
            optimiser.zero_grad(set_to_none=True)
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
            schedule.step()


def diagonal_kl(mu: Tensor, sigma: Tensor, mean: Tensor, log_variance: Tensor) -> Tensor:
    """D_KL(N(μ, diag σ²) ‖ N(mean, diag exp(log_variance))) of each row, (B,) in nats."""
    ratio = (sigma**2 + (mu - mean) ** 2) * (-log_variance).exp()
    return 0.5 * (ratio - 1.0 + log_variance - 2.0 * sigma.log()).sum(dim=-1)
