"""How much a mode tells of a property: all, nothing, or a known part."""

import numpy as np
import pytest

from lmtr.errors import DataError
from lmtr.models.mode_content import choice_explained, variance_explained

RNG = np.random.default_rng(0)
MODES = RNG.normal(size=(3000, 2))


def test_a_smooth_function_of_the_mode_is_explained_though_it_is_not_linear():
    assert variance_explained(MODES, MODES[:, 0] ** 2) > 0.93


def test_what_has_nothing_to_do_with_the_mode_is_not_explained():
    assert variance_explained(MODES, RNG.normal(size=3000)) < 0.03
    assert choice_explained(MODES, RNG.integers(0, 4, 3000)) < 0.05


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_a_known_part_of_the_variance_is_found(share):
    values = np.sqrt(share) * MODES[:, 0] + np.sqrt(1.0 - share) * RNG.normal(size=3000)
    assert variance_explained(MODES, values) == pytest.approx(share, abs=0.05)


def test_a_choice_that_the_mode_decides_is_explained():
    assert choice_explained(MODES, (MODES[:, 0] > 0.0).astype(np.intp)) > 0.95


def test_what_does_not_vary_has_no_share():
    assert np.isnan(variance_explained(MODES, np.ones(3000)))
    assert np.isnan(choice_explained(MODES, np.zeros(3000, dtype=np.intp)))


def test_too_few_modes_are_refused():
    with pytest.raises(DataError, match="more than 15 modes"):
        variance_explained(MODES[:10], MODES[:10, 0])
