"""Fully-connected networks in torch: how they are made, and how they leave it."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise

import torch
from torch import nn

from lmtr.models.perceptron import Perceptron
from lmtr.models.settings import Activation

_ACTIVATIONS: dict[Activation, type[nn.Module]] = {
    "elu": nn.ELU,
    "relu": nn.ReLU,
    "tanh": nn.Tanh,
}


def fully_connected(sizes: tuple[int, ...], activation: Activation) -> nn.Sequential:
    """Linear layers between these sizes with an activation between any two of them."""
    layers: list[nn.Module] = []
    for inputs, outputs in pairwise(sizes):
        layers += [nn.Linear(inputs, outputs), _ACTIVATIONS[activation]()]
    return nn.Sequential(*layers[:-1])  # the last layer is linear


def as_perceptron(network: nn.Sequential, activation: Activation) -> Perceptron:
    """The same network without torch, in double precision."""
    layers = [layer for layer in network if isinstance(layer, nn.Linear)]
    return Perceptron(
        weights=tuple(layer.weight.detach().double().cpu().numpy().T.copy() for layer in layers),
        biases=tuple(layer.bias.detach().double().cpu().numpy().copy() for layer in layers),
        activation=activation,
    )


@contextmanager
def torch_threads(count: int) -> Iterator[None]:
    """Let torch use so many threads inside the block."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)
