"""The CVAE: how modes are drawn, and what encoder and decoder look at (Eq. 4)."""

import numpy as np
import pytest
import torch

from lmtr.models.cvae import CVAE
from lmtr.models.perceptron import Perceptron
from lmtr.models.settings import ModelSettings, TrainingSettings
from lmtr.models.trained import TrainedModel
from lmtr.robot.model import ANYMAL
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT
from lmtr.vectors.scaling import Standardiser

DRAWS = 20_000


@pytest.fixture
def cvae():
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(3)
        return CVAE(35, 264, ModelSettings(latent=3, hidden=(16, 24)))


def numbers(seed, *shape):
    return torch.randn(shape, generator=torch.Generator().manual_seed(seed))


def test_modes_are_drawn_around_mu_with_standard_deviation_sigma(cvae, monkeypatch):
    mu, log_variance = torch.tensor([0.5, -1.0, 2.0]), torch.tensor([-3.0, 0.0, 1.5])
    rows = (DRAWS, 3)
    monkeypatch.setattr(cvae, "encode", lambda tau, x: (mu.expand(rows), log_variance.expand(rows)))
    drawn = []
    monkeypatch.setattr(cvae, "decode", lambda z, x: drawn.append(z))
    cvae(numbers(0, 1, 264), numbers(1, 1, 35), torch.Generator().manual_seed(4))
    (z,) = (np.asarray(modes, dtype=float) for modes in drawn)
    sigma = np.exp([-1.5, 0.0, 0.75])
    # The spread of n draws is known to one part in sqrt(2 n): half a per cent; 5 of these.
    np.testing.assert_allclose(z.std(axis=0), sigma, rtol=0.025)
    np.testing.assert_allclose((z.mean(axis=0) - [0.5, -1.0, 2.0]) / sigma, 0.0, atol=0.035)
    # Each dimension has noise of its own.
    assert np.abs(np.corrcoef(z.T) - np.eye(3)).max() < 0.035


def test_each_row_and_each_call_draws_anew_and_a_seed_repeats_it(cvae):
    tau, x = numbers(0, 1, 264).expand(5, 264), numbers(1, 1, 35).expand(5, 35)
    noise = torch.Generator().manual_seed(4)
    once, twice = (cvae(tau, x, noise).tau_hat for _ in range(2))
    again = cvae(tau, x, torch.Generator().manual_seed(4)).tau_hat
    assert torch.equal(once, again)
    assert not torch.allclose(once, twice)
    assert not torch.allclose(once[0], once[1])


@pytest.mark.parametrize("quantity", [0, 1], ids=["mu", "log_variance"])
def test_the_encoder_looks_at_the_task_as_well_as_at_the_segment(cvae, quantity):
    tau, x = numbers(0, 6, 264), numbers(1, 6, 35)
    here = cvae.encode(tau, x)[quantity]
    assert (cvae.encode(tau, numbers(2, 6, 35))[quantity] - here).abs().mean() > 1e-2
    assert (cvae.encode(numbers(3, 6, 264), x)[quantity] - here).abs().mean() > 1e-2
    assert torch.equal(cvae.encode(tau, x)[quantity], here)


def test_the_decoder_looks_at_the_task_as_well_as_at_the_mode(cvae):
    z, x = numbers(0, 6, 3), numbers(1, 6, 35)
    here = cvae.decode(z, x)
    assert (cvae.decode(z, numbers(2, 6, 35)) - here).abs().mean() > 1e-3
    assert (cvae.decode(numbers(3, 6, 3), x) - here).abs().mean() > 1e-3


def test_gradients_reach_the_spread_through_the_drawn_mode(cvae):
    out = cvae(numbers(0, 8, 264), numbers(1, 8, 35), torch.Generator().manual_seed(4))
    out.log_variance.retain_grad()
    out.tau_hat.square().sum().backward()
    assert out.log_variance.grad.abs().min() > 0.0


def test_sigma_of_the_numpy_model_is_that_by_which_torch_spreads_its_draws(cvae):
    model = TrainedModel(
        settings=ModelSettings(latent=3, hidden=(16, 24)),
        training=TrainingSettings(),
        robot=ANYMAL,
        task_scaling=unscaled(TASK_LAYOUT),
        segment_scaling=unscaled(SEGMENT_LAYOUT),
        decoder=perceptron(cvae.decoder),
        encoder=perceptron(cvae.encoder),
    )
    tau, x = numbers(0, 4, 264), numbers(1, 4, 35)
    mu, sigma = model.encode(tau.double().numpy(), x.double().numpy())
    many = (part.repeat(DRAWS, 1) for part in (tau, x))
    with torch.no_grad():
        drawn = draws_of(cvae, *many).double().numpy().reshape(DRAWS, 4, 3)
        torch_mu, log_variance = cvae.encode(tau, x)
    np.testing.assert_allclose(sigma, np.exp(0.5 * log_variance.numpy()), rtol=1e-5)
    np.testing.assert_allclose(mu, torch_mu.numpy(), atol=1e-5)
    np.testing.assert_allclose(drawn.std(axis=0), sigma, rtol=0.025)


def draws_of(cvae, tau, x):
    """The modes that a pass through the CVAE draws."""
    seen = []
    hook = cvae.decoder.register_forward_pre_hook(lambda _, inputs: seen.append(inputs[0]))
    cvae(tau, x, torch.Generator().manual_seed(5))
    hook.remove()
    return seen[0][:, : cvae.latent]


def unscaled(layout):
    return Standardiser(layout, np.zeros(layout.size), np.ones(layout.size))


def perceptron(network):
    layers = [layer for layer in network if isinstance(layer, torch.nn.Linear)]
    return Perceptron(
        weights=tuple(layer.weight.detach().double().numpy().T for layer in layers),
        biases=tuple(layer.bias.detach().double().numpy() for layer in layers),
        activation="elu",
    )
