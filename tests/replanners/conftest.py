"""Expert segments of walks, small models on them, and every kind of replanner."""

from collections.abc import Callable

import numpy as np
import pytest

from lmtr.models.data import TrainingData
from lmtr.models.settings import ModelSettings, TrainingSettings
from lmtr.models.trained import TrainedModel
from lmtr.models.training import train
from lmtr.policies.distance import TaskWeights
from lmtr.policies.mode_policy import PriorModePolicy, ZeroModePolicy
from lmtr.replanners.build import build_replanner
from lmtr.replanners.latent_mode import LatentModeReplanner
from lmtr.replanners.replanner import Replanner
from lmtr.robot.model import ANYMAL
from lmtr.segmentation.segment import SegmentationSettings, segment_solution

WEIGHTS = TaskWeights(eta=5.0, gamma=0.5)


@pytest.fixture(scope="session")
def expert(walk: Callable) -> TrainingData:
    """Segments of six walks."""
    rng, settings = np.random.default_rng(0), SegmentationSettings(epochs_per_solution=10)
    parts = [
        segment_solution(w.trajectory, w.task.obstacles_W, settings, rng)
        for w in map(walk, range(6))
    ]
    return TrainingData(
        np.concatenate([p.x for p in parts]), np.concatenate([p.tau for p in parts])
    )


@pytest.fixture(scope="session")
def models(expert: TrainingData) -> dict[int, TrainedModel]:
    """Small models by latent size."""
    brief = TrainingSettings(
        epochs=100, batch_size=40, validate_every=20, learning_rate=5e-3, device="cpu"
    )
    return {
        n: train(ModelSettings(latent=n, hidden=(32, 64)), brief, expert, expert, ANYMAL)
        for n in (0, 3)
    }


@pytest.fixture(
    scope="session",
    params=["unimodal", "LMTR-3", "LMTR-3 (zero)", "LMTR-3 (prior)", "library"],
)
def named(
    request: pytest.FixtureRequest, models: dict[int, TrainedModel], expert: TrainingData
) -> tuple[str, Replanner]:
    """Each replanner with the name that it should have."""
    makers: dict[str, Callable[[], Replanner]] = {
        "unimodal": lambda: build_replanner(models[0], expert, WEIGHTS),
        "LMTR-3": lambda: build_replanner(models[3], expert, WEIGHTS),
        "LMTR-3 (zero)": lambda: LatentModeReplanner(models[3], ZeroModePolicy(3)),
        "LMTR-3 (prior)": lambda: LatentModeReplanner(models[3], PriorModePolicy(3, seed=0)),
        "library": lambda: build_replanner(None, expert, WEIGHTS),
    }
    return request.param, makers[request.param]()
