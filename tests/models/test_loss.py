"""The loss of Eq. 5: closed forms and laws of the divergence."""

import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from torch.distributions import Normal, kl_divergence

from lmtr.models.latent import active_dimensions
from lmtr.models.loss import cvae_loss, gaussian_kl

moments = hnp.arrays(np.float64, (5, 3), elements=st.floats(-3.0, 3.0))


@given(mu=moments, log_variance=moments)
def test_kl_is_that_of_torch_and_never_negative(mu, log_variance):
    mean, spread = torch.as_tensor(mu), torch.as_tensor(log_variance)
    ours = gaussian_kl(mean, spread)
    theirs = kl_divergence(Normal(mean, (0.5 * spread).exp()), Normal(0.0, 1.0)).sum(-1)
    torch.testing.assert_close(ours, theirs, rtol=1e-9, atol=1e-12)
    assert (ours >= -1e-12).all()


def test_kl_of_the_prior_and_of_no_latent_space_is_zero():
    assert gaussian_kl(torch.zeros(4, 2), torch.zeros(4, 2)).tolist() == [0.0] * 4
    assert gaussian_kl(torch.zeros(4, 0), torch.zeros(4, 0)).tolist() == [0.0] * 4


def test_loss_by_hand():
    tau = torch.tensor([[1.0, -2.0], [0.0, 0.0]])
    mu, log_variance = torch.tensor([[1.0], [0.0]]), torch.zeros(2, 1)
    arguments = (tau, torch.zeros(2, 2), mu, log_variance)
    mean = cvae_loss(*arguments, kappa=0.1, reduction="mean")
    assert (float(mean.reconstruction), float(mean.kl)) == (0.75, 0.25)
    np.testing.assert_allclose(float(mean.total), 0.75 + 0.1 * 0.25)
    total = cvae_loss(*arguments, kappa=0.1, reduction="sum")
    assert float(total.reconstruction) == 2 * 0.75


def test_a_dimension_is_active_where_its_mean_varies():
    rng = np.random.default_rng(0)
    mu = rng.standard_normal((500, 3)) * np.array([1.0, 0.05, 0.2]) + 3.0
    assert active_dimensions(mu).tolist() == [True, False, True]
