"""Weights of the reconstruction error: another scaling of τ is a weight for each dimension."""

import numpy as np
import pytest
import torch

from lmtr.errors import ModelError
from lmtr.models.loss import cvae_loss
from lmtr.models.settings import ModelSettings, TrainingSettings
from lmtr.models.training import train
from lmtr.models.weighting import LossWeights
from lmtr.robot.model import ANYMAL
from lmtr.vectors.layout import SEGMENT_LAYOUT
from lmtr.vectors.scaling import Standardiser


@pytest.fixture
def scaling(walk_segments):
    return Standardiser.fit(SEGMENT_LAYOUT, walk_segments.tau)


def test_all_dimensions_may_count_alike_and_by_default_footholds_count_more(scaling):
    np.testing.assert_allclose(LossWeights(motion=1.0).of(scaling, ANYMAL.weight), 1.0)
    weights = SEGMENT_LAYOUT.unpack(LossWeights().of(scaling, ANYMAL.weight))
    np.testing.assert_allclose(weights["LF_second_foothold"], 5.0 * weights["RH_times"][0])


def test_in_units_the_error_is_that_in_si_units(scaling, walk_segments):
    weights = LossWeights(scale="unit", motion=1.0).of(scaling, ANYMAL.weight)
    tau, other = walk_segments.tau[:40], walk_segments.tau[40:80]
    loss = cvae_loss(
        *(torch.as_tensor(scaling.apply(each)) for each in (tau, other)),
        torch.zeros(40, 0),
        torch.zeros(40, 0),
        kappa=0.0,
        reduction="sum",
        weights=torch.as_tensor(weights),
    )
    error = SEGMENT_LAYOUT.unpack(np.abs(tau - other) * ~scaling.constant)
    total = sum(
        values.reshape(40, -1).sum() / (ANYMAL.weight if name.endswith("forces") else 1.0)
        for name, values in error.items()
    )
    second = 12  # the second base node's x: the first one is constant
    factor = weights[second] / scaling.scale[second]  # all weights are one in the mean
    np.testing.assert_allclose(float(loss.reconstruction), factor * total / 40, rtol=1e-5)


def test_within_a_field_what_varies_more_counts_more(scaling):
    weights = SEGMENT_LAYOUT.unpack(LossWeights(scale="field").of(scaling, ANYMAL.weight))
    spread = SEGMENT_LAYOUT.unpack(scaling.scale)
    feet = [
        np.concatenate([each[f"{f}_times"] for f in ("LF", "RH")]) for each in (weights, spread)
    ]
    np.testing.assert_allclose(feet[0] / feet[0][0], feet[1] / feet[1][0])
    base = weights["base_nodes"].reshape(-1, 2, 2, 3)
    typical = np.sqrt((base**2).mean(axis=(0, 3)))
    np.testing.assert_allclose(typical, typical[0, 0])  # positions, angles and both rates alike


def test_a_category_that_does_not_count_is_not_learnt(walk_segments):
    settings = TrainingSettings(epochs=80, batch_size=40, patience=None, device="cpu")

    def learnt(**weights):
        model = ModelSettings(latent=2, hidden=(32, 32), loss_weights=LossWeights(**weights))
        look = train(model, settings, walk_segments, walk_segments, ANYMAL).best_epoch.validation
        return look.errors

    all_, timeless = learnt(), learnt(times=0.0)
    assert timeless.times_ms > 1.5 * all_.times_ms
    assert timeless.base_position_mm < 1.2 * all_.base_position_mm


@pytest.mark.parametrize("reduction", ["mean", "sum"])
def test_feet_begin_where_they_are_if_the_start_counts(walk_segments, reduction):
    settings = TrainingSettings(epochs=80, batch_size=40, patience=None, device="cpu")

    def learnt(start):
        model = ModelSettings(
            latent=2,
            hidden=(32, 32),
            reduction=reduction,
            loss_weights=LossWeights(start=start),
        )
        return train(model, settings, walk_segments, walk_segments, ANYMAL).best_epoch.validation

    without, with_start = learnt(0.0), learnt(1.0)
    assert with_start.errors.epoch_feet_mm < 0.7 * without.errors.epoch_feet_mm
    # It is told apart from the error of τ, and only the total holds it.
    kappa = ModelSettings().kappa
    assert without.loss == pytest.approx(without.reconstruction + kappa * without.kl, rel=1e-4)
    assert with_start.loss > 1.001 * (with_start.reconstruction + kappa * with_start.kl)


def test_something_has_to_count(scaling):
    nothing = LossWeights(base=0.0, times=0.0, motion=0.0, forces=0.0)
    with pytest.raises(ModelError, match=r"^loss weights: .*loss_weights$"):
        nothing.of(scaling, ANYMAL.weight)
