"""Expert segments of walks, small models on them, and every kind of replanner."""

from collections.abc import Callable

import pytest

from lmtr.models.data import TrainingData
from lmtr.models.mode_regressor import fit_mode_regressor
from lmtr.models.settings import ModelSettings, ModeRegressorSettings, TrainingSettings
from lmtr.models.trained import TrainedModel
from lmtr.models.training import train
from lmtr.policies.distance import TaskWeights
from lmtr.policies.gaussian_policy import GaussianModePolicy
from lmtr.policies.mode_policy import PriorModePolicy, ZeroModePolicy
from lmtr.replanners.build import build_replanner
from lmtr.replanners.latent_mode import LatentModeReplanner
from lmtr.replanners.replanner import Replanner
from lmtr.replanners.selecting import Selection
from lmtr.robot.model import ANYMAL

WEIGHTS = TaskWeights(eta=5.0, gamma=0.5)
SELECTION = Selection(candidates=4)


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
    params=[
        "unimodal",
        "LMTR-3",
        "LMTR-3 (zero)",
        "LMTR-3 (prior)",
        "LMTR-3 (best of 4)",
        "library",
        "library (best of 4)",
        "LMTR-3 (gaussian)",
    ],
)
def named(
    request: pytest.FixtureRequest, models: dict[int, TrainedModel], walk_segments: TrainingData
) -> tuple[str, Replanner]:
    """Each replanner with the name that it should have."""

    def gaussian(model: TrainedModel) -> GaussianModePolicy:
        network = fit_mode_regressor(model, walk_segments, ModeRegressorSettings(epochs=5))
        return GaussianModePolicy(network, model.task_scaling)

    makers: dict[str, Callable[[], Replanner]] = {
        "unimodal": lambda: build_replanner(models[0], walk_segments, WEIGHTS),
        "LMTR-3": lambda: build_replanner(models[3], walk_segments, WEIGHTS),
        "LMTR-3 (zero)": lambda: LatentModeReplanner(models[3], ZeroModePolicy(3)),
        "LMTR-3 (prior)": lambda: LatentModeReplanner(models[3], PriorModePolicy(3, seed=0)),
        "LMTR-3 (best of 4)": lambda: build_replanner(
            models[3], walk_segments, WEIGHTS, selection=SELECTION
        ),
        "library": lambda: build_replanner(None, walk_segments, WEIGHTS),
        "library (best of 4)": lambda: build_replanner(
            None, walk_segments, WEIGHTS, selection=SELECTION, robot=ANYMAL
        ),
        "LMTR-3 (gaussian)": lambda: LatentModeReplanner(models[3], gaussian(models[3])),
    }
    return request.param, makers[request.param]()
