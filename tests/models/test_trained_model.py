"""Plans and modes of a trained model."""

import subprocess
import sys

import numpy as np
import pytest

from lmtr.errors import DataError


@pytest.mark.parametrize("latent", [0, 3])
def test_a_plan_is_the_decoder_between_its_scalings(small_model, walk_segments, latent):
    model = small_model(latent)
    z = np.random.default_rng(0).standard_normal((len(walk_segments.x), latent))
    scaled = model.task_scaling.apply(walk_segments.x)
    expected = model.segment_scaling.invert(model.decoder(np.concatenate([z, scaled], axis=1)))
    np.testing.assert_allclose(model.predict(walk_segments.x, z), expected, rtol=1e-9, atol=1e-9)


def test_constant_dimensions_come_back_as_they_were(small_model, walk_segments):
    model = small_model(3)
    assert model.segment_scaling.constant.any()
    tau = model.predict(walk_segments.x, np.ones((len(walk_segments.x), 3)))
    constant = model.segment_scaling.constant
    np.testing.assert_array_equal(tau[:, constant], walk_segments.tau[:, constant])


def test_modes_have_a_spread_and_the_regressor_has_none(small_model, walk_segments):
    mu, sigma = small_model(3).encode(walk_segments.tau, walk_segments.x)
    assert mu.shape == sigma.shape == (len(walk_segments.x), 3)
    assert (sigma > 0.0).all()
    mu, sigma = small_model(0).encode(walk_segments.tau, walk_segments.x)
    assert mu.shape == sigma.shape == (len(walk_segments.x), 0)


def test_inputs_of_another_shape_are_refused(small_model, walk_segments):
    model, x = small_model(3), walk_segments.x
    with pytest.raises(DataError, match=r"modes must have shape \(5, 3\)"):
        model.predict(x[:5], np.zeros((5, 2)))
    with pytest.raises(DataError, match="one row"):
        model.predict(x[0], np.zeros((1, 3)))
    with pytest.raises(DataError, match="got 4 and 5"):
        model.encode(walk_segments.tau[:4], x[:5])


def test_planning_does_not_import_torch():
    code = (
        "import sys, lmtr.replanners.build, lmtr.models.checkpoint; print('torch' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
