"""Standardisation and its inverse."""

import json

import numpy as np
import pytest

from lmtr.errors import DataError
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT
from lmtr.vectors.scaling import Standardiser


def rows(n=50):
    rng = np.random.default_rng(5)
    return rng.normal(size=(n, TASK_LAYOUT.size)) * np.geomspace(0.01, 100.0, TASK_LAYOUT.size) + 3


def test_scaled_data_have_zero_mean_and_unit_spread_and_come_back():
    data = rows()
    standardiser = Standardiser.fit(TASK_LAYOUT, data)
    scaled = standardiser.apply(data)
    assert scaled.mean(axis=0) == pytest.approx(0.0, abs=1e-9)
    assert scaled.std(axis=0) == pytest.approx(1.0)
    assert standardiser.invert(scaled) == pytest.approx(data)


def test_constant_dimensions_come_back_exactly_whatever_is_predicted():
    data = rows()
    constant = TASK_LAYOUT.slice("roll_pitch")
    data[:, constant] = 0.1 + 0.2  # summed up and divided again, it is another number
    standardiser = Standardiser.fit(TASK_LAYOUT, data)
    assert standardiser.constant.sum() == 2
    assert (standardiser.apply(data + 1.0)[:, constant] == 0.0).all()
    guess = np.random.default_rng(1).normal(size=data.shape)
    assert (standardiser.invert(guess)[:, constant] == 0.1 + 0.2).all()


def test_a_stored_standardiser_is_the_same():
    data = rows()
    standardiser = Standardiser.fit(TASK_LAYOUT, data)
    stored = json.dumps({k: v.tolist() for k, v in standardiser.to_dict().items()})
    again = Standardiser.from_dict(TASK_LAYOUT, json.loads(stored))
    assert np.array_equal(again.apply(data), standardiser.apply(data))


def test_nan_is_refused_with_the_name_of_its_field():
    data = rows()
    standardiser = Standardiser.fit(TASK_LAYOUT, data)
    data[3, TASK_LAYOUT.slice("goal_heading")] = np.nan
    with pytest.raises(DataError, match=r"'goal_heading'.*1 of 50"):
        Standardiser.fit(TASK_LAYOUT, data)
    with pytest.raises(DataError, match="'goal_heading'"):
        standardiser.apply(data)


def test_a_standardiser_of_another_layout_is_refused():
    arrays = Standardiser.fit(TASK_LAYOUT, rows()).to_dict()
    with pytest.raises(DataError, match="264"):
        Standardiser.from_dict(SEGMENT_LAYOUT, arrays)
    with pytest.raises(DataError, match="at least 2"):
        Standardiser.fit(TASK_LAYOUT, rows(1))
