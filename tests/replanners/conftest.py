"""Expert segments of walks, small models on them, and every kind of replanner."""

from collections.abc import Callable

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

WEIGHTS = TaskWeights(eta=5.0, gamma=0.5)


@pytest.fixture(scope="session")
def models(walk_segments: TrainingData) -> dict[int, TrainedModel]:
    """Small models by latent size."""
    brief = TrainingSettings(
        epochs=100, batch_size=40, validate_every=20, learning_rate=5e-3, device="cpu"
    )
    return {
        n: train(
            ModelSettings(latent=n, hidden=(32, 64)), brief, walk_segments, walk_segments, ANYMAL
        )
        for n in (0, 3)
    }


@pytest.fixture(
    scope="session",
    params=["unimodal", "LMTR-3", "LMTR-3 (zero)", "LMTR-3 (prior)", "library"],
)
def named(
    request: pytest.FixtureRequest, models: dict[int, TrainedModel], walk_segments: TrainingData
) -> tuple[str, Replanner]:
    """Each replanner with the name that it should have."""
    makers: dict[str, Callable[[], Replanner]] = {
        "unimodal": lambda: build_replanner(models[0], walk_segments, WEIGHTS),
        "LMTR-3": lambda: build_replanner(models[3], walk_segments, WEIGHTS),
        "LMTR-3 (zero)": lambda: LatentModeReplanner(models[3], ZeroModePolicy(3)),
        "LMTR-3 (prior)": lambda: LatentModeReplanner(models[3], PriorModePolicy(3, seed=0)),
        "library": lambda: build_replanner(None, walk_segments, WEIGHTS),
    }
    return request.param, makers[request.param]()
