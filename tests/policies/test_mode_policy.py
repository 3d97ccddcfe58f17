"""Mode policies on a library whose modes are known."""

import numpy as np
import pytest

from lmtr.errors import DataError
from lmtr.models.perceptron import Perceptron
from lmtr.models.settings import ModelSettings, TrainingSettings
from lmtr.models.trained import CHUNK, TrainedModel
from lmtr.policies.distance import TaskWeights
from lmtr.policies.mode_library import ModeLibrary, mode_library
from lmtr.policies.mode_policy import NearestModePolicy, PriorModePolicy, ZeroModePolicy
from lmtr.robot.model import ANYMAL
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT
from lmtr.vectors.scaling import Standardiser

UNIT = Standardiser(TASK_LAYOUT, np.zeros(TASK_LAYOUT.size), np.ones(TASK_LAYOUT.size))


@pytest.fixture
def library() -> ModeLibrary:
    rng = np.random.default_rng(0)
    return ModeLibrary(rng.standard_normal((40, TASK_LAYOUT.size)), rng.standard_normal((40, 3)))


@pytest.fixture
def linear_model() -> TrainedModel:
    """An encoder of one layer: μ is linear in (τ, x) and σ = 0.5 everywhere."""
    rng = np.random.default_rng(1)
    sizes = SEGMENT_LAYOUT.size, TASK_LAYOUT.size
    weight = np.concatenate([rng.standard_normal((sum(sizes), 2)), np.zeros((sum(sizes), 2))], 1)
    bias = np.array([0.0, 0.0, 2.0 * np.log(0.5), 2.0 * np.log(0.5)])
    return TrainedModel(
        settings=ModelSettings(latent=2),
        training=TrainingSettings(),
        robot=ANYMAL,
        task_scaling=UNIT,
        segment_scaling=Standardiser(SEGMENT_LAYOUT, np.zeros(sizes[0]), np.ones(sizes[0])),
        decoder=Perceptron((np.zeros((2 + sizes[1], sizes[0])),), (np.zeros(sizes[0]),), "elu"),
        encoder=Perceptron((weight,), (bias,), "elu"),
    )


def test_the_nearest_policy_takes_the_mode_of_the_nearest_task(library):
    policy = NearestModePolicy(library, TaskWeights(), UNIT)
    np.testing.assert_array_equal(policy.select(library.x[::-1] + 1e-4), library.z[::-1])
    assert policy.latent == 3
    assert policy.describe()["rows"] == 40
    assert policy.nbytes >= 40 * (TASK_LAYOUT.size * 4 + 3 * 8)


def test_unpaired_libraries_are_refused(library):
    with pytest.raises(DataError, match="got 40 and 39"):
        NearestModePolicy(ModeLibrary(library.x, library.z[1:]), TaskWeights(), UNIT)


def test_the_library_holds_mean_modes_whatever_the_chunks(linear_model):
    rng = np.random.default_rng(2)
    x = rng.standard_normal((CHUNK + 10, TASK_LAYOUT.size))
    tau = rng.standard_normal((CHUNK + 10, SEGMENT_LAYOUT.size))
    modes = mode_library(linear_model, x, tau)
    parts = [linear_model.encode(tau[r], x[r])[0] for r in (slice(0, 900), slice(900, None))]
    np.testing.assert_allclose(modes.z, np.concatenate(parts), atol=1e-12)
    assert modes.x is x
    with pytest.raises(DataError, match="as many"):
        mode_library(linear_model, x, tau[:-1])


def test_sampled_modes_scatter_by_sigma_around_the_means(linear_model):
    rng = np.random.default_rng(3)
    x = rng.standard_normal((4000, TASK_LAYOUT.size))
    tau = rng.standard_normal((4000, SEGMENT_LAYOUT.size))
    scatter = (
        mode_library(linear_model, x, tau, np.random.default_rng(4)).z
        - mode_library(linear_model, x, tau).z
    )
    np.testing.assert_allclose(scatter.std(axis=0), 0.5, rtol=0.05)
    np.testing.assert_allclose(scatter.mean(axis=0), 0.0, atol=0.05)


def test_the_zero_policy_is_zero(library):
    assert not ZeroModePolicy(3).select(library.x).any()
    assert ZeroModePolicy(3).select(library.x).shape == (40, 3)


def test_prior_draws_depend_on_seed_and_task_alone():
    x = np.random.default_rng(5).standard_normal((3000, TASK_LAYOUT.size))
    z = PriorModePolicy(2, seed=0).select(x)
    np.testing.assert_array_equal(PriorModePolicy(2, seed=0).select(x[::-1])[::-1], z)
    assert not np.array_equal(PriorModePolicy(2, seed=1).select(x), z)
    np.testing.assert_allclose(z.mean(axis=0), 0.0, atol=0.06)
    np.testing.assert_allclose(np.cov(z.T), np.eye(2), atol=0.1)
