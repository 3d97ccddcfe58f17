"""Small data sets and models: segments of walks, and a task space with two known modes."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from lmtr.models.data import TrainingData
from lmtr.models.settings import ModelSettings, TrainingSettings
from lmtr.models.trained import TrainedModel
from lmtr.models.training import train
from lmtr.robot.model import ANYMAL
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT


@dataclass(frozen=True)
class Fork:
    """Every task has two solutions that differ in the footholds alone (Eq. 3).

    Attributes:
        x: Tasks (N, 35).
        left, right: The two solutions of each, (N, 264).
        gap: Distance of the two in each dimension in which they differ.
        differs: Those dimensions.
    """

    x: np.ndarray
    left: np.ndarray
    right: np.ndarray
    gap: float
    differs: np.ndarray

    @property
    def data(self) -> TrainingData:
        """Each task twice, once with either solution."""
        return TrainingData(
            np.concatenate([self.x, self.x]), np.concatenate([self.left, self.right])
        )


@pytest.fixture(scope="session")
def fork() -> Callable[[int, int], Fork]:
    """Forks by size and seed."""

    def make(size: int, seed: int) -> Fork:
        rng = np.random.default_rng(seed)
        # Tasks vary in three directions, and what the solutions share is smooth in them.
        directions = np.random.default_rng(99)
        cause = rng.standard_normal((size, 3))
        x = cause @ directions.standard_normal((3, TASK_LAYOUT.size))
        tau = np.tanh(cause @ directions.standard_normal((3, SEGMENT_LAYOUT.size)) / 3.0)
        differs = SEGMENT_LAYOUT.category_indices()["motion"]
        half = 0.5
        left, right = tau.copy(), tau.copy()
        left[:, differs] += half
        right[:, differs] -= half
        return Fork(x, left, right, 2.0 * half, differs)

    return make


@pytest.fixture(scope="session")
def small_model(walk_segments: TrainingData) -> Callable[[int], TrainedModel]:
    """Briefly trained small models by latent size."""

    def make(latent: int) -> TrainedModel:
        return train(
            ModelSettings(latent=latent, hidden=(16, 24)),
            TrainingSettings(
                epochs=3, batch_size=32, validate_every=2, patience=None, device="cpu"
            ),
            walk_segments,
            walk_segments,
            ANYMAL,
            provenance={"data": "walks"},
        )

    return make
