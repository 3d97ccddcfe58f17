"""Inference in NumPy against torch, and folded scalings."""

from itertools import pairwise
from typing import get_args

import numpy as np
import pytest
import torch

from lmtr.models.cvae import CVAE
from lmtr.models.perceptron import Affine, Perceptron
from lmtr.models.settings import Activation, ModelSettings


def random_network(sizes: tuple[int, ...], activation: Activation) -> Perceptron:
    rng = np.random.default_rng(1)
    pairs = list(pairwise(sizes))
    return Perceptron(
        tuple(rng.standard_normal(pair) for pair in pairs),
        tuple(rng.standard_normal(outputs) for _, outputs in pairs),
        activation,
    )


@pytest.mark.parametrize("activation", get_args(Activation))
def test_numpy_and_torch_compute_the_same(activation):
    cvae = CVAE(5, 7, ModelSettings(latent=2, hidden=(6, 9), activation=activation)).double()
    linear = [layer for layer in cvae.decoder if isinstance(layer, torch.nn.Linear)]
    network = Perceptron(
        tuple(layer.weight.detach().numpy().T for layer in linear),
        tuple(layer.bias.detach().numpy() for layer in linear),
        activation,
    )
    inputs = 4.0 * np.random.default_rng(0).standard_normal((20, 7))
    z, x = torch.as_tensor(inputs[:, :2]), torch.as_tensor(inputs[:, 2:])
    expected = cvae.decode(z, x).detach().numpy()
    np.testing.assert_allclose(network(inputs), expected, rtol=1e-12, atol=1e-12)


def test_scaling_can_be_folded_into_both_ends():
    network = random_network((4, 6, 3), "elu")
    rng = np.random.default_rng(2)
    before = Affine(rng.standard_normal(4), rng.standard_normal(4))
    behind = Affine(rng.standard_normal(3), rng.standard_normal(3))
    inputs = rng.standard_normal((10, 4))
    expected = network(inputs * before.scale + before.shift) * behind.scale + behind.shift
    folded = network.after(before).then(behind)
    np.testing.assert_allclose(folded(inputs), expected, rtol=1e-12, atol=1e-12)


def test_extreme_inputs_stay_finite_in_elu():
    network = random_network((2, 8, 1), "elu")
    assert np.isfinite(network(np.array([[1e6, -1e6], [-1e6, 1e6]]))).all()


def test_memory_is_that_of_the_numbers():
    assert random_network((4, 6, 3), "relu").nbytes == 8 * (4 * 6 + 6 + 6 * 3 + 3)
