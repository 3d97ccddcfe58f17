"""π_N follows the encoder: closed form of its loss, and the mean where two modes share a task."""

import numpy as np
import pytest
import torch
from torch.distributions import Independent, Normal, kl_divergence

from lmtr.models.mode_regressor import diagonal_kl, fit_mode_regressor
from lmtr.models.settings import ModelSettings, ModeRegressorSettings, TrainingSettings
from lmtr.models.training import train
from lmtr.policies.gaussian_policy import GaussianModePolicy
from lmtr.robot.model import ANYMAL


def test_the_loss_is_the_divergence_between_gaussians():
    generator = torch.Generator().manual_seed(0)
    mu, mean, log_variance = (torch.randn(5, 3, generator=generator) for _ in range(3))
    sigma = torch.rand(5, 3, generator=generator) + 0.1
    expected = kl_divergence(
        Independent(Normal(mu, sigma), 1),
        Independent(Normal(mean, (0.5 * log_variance).exp()), 1),
    )
    torch.testing.assert_close(diagonal_kl(mu, sigma, mean, log_variance), expected)


@pytest.fixture(scope="module")
def model(walk_segments):
    settings = TrainingSettings(
        epochs=100, batch_size=40, validate_every=20, learning_rate=5e-3, device="cpu"
    )
    shape = ModelSettings(latent=3, hidden=(32, 64))
    return train(shape, settings, walk_segments, walk_segments, ANYMAL)


@pytest.fixture(scope="module")
def policy(model, walk_segments):
    network = fit_mode_regressor(model, walk_segments, ModeRegressorSettings(epochs=200))
    return GaussianModePolicy(network, model.task_scaling)


def test_it_explains_the_encoders_modes(policy, model, walk_segments):
    mu, _ = model.encode(walk_segments.tau, walk_segments.x)
    found, spread = policy.moments(walk_segments.x)
    unexplained = ((mu - found) ** 2).sum(axis=0) / ((mu - mu.mean(axis=0)) ** 2).sum(axis=0)
    assert unexplained.min() < 0.25
    # What the task does not tell is in the spread, never hidden behind a mean that claims too much.
    surprise = (((mu - found) / spread) ** 2).mean(axis=0)
    assert (surprise < 1.5).all()
    np.testing.assert_array_equal(policy.select(walk_segments.x), found)


def test_the_same_seed_makes_the_same_network(model, walk_segments):
    settings = ModeRegressorSettings(epochs=2)
    one, other = (fit_mode_regressor(model, walk_segments, settings) for _ in range(2))
    np.testing.assert_array_equal(one.weights[0], other.weights[0])
