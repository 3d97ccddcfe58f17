"""Pareto fronts, their thinning and interpolation, against cases worked out by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lmtr.errors import ConfigurationError
from lmtr.rollout.fronts import chosen, interpolated, pareto_front, spread_along


def test_a_front_by_hand():
    points = np.array([[3.0, 1.0], [1.0, 3.0], [2.0, 2.0], [2.0, 2.5], [3.0, 3.0], [np.nan, 0.0]])
    assert pareto_front(points).tolist() == [1, 2, 0]


def test_of_equal_points_the_first_is_kept():
    assert pareto_front(np.array([[1.0, 1.0], [1.0, 1.0], [1.0, 2.0]])).tolist() == [0]


@given(arrays(float, st.tuples(st.integers(1, 12), st.just(2)), elements=st.integers(0, 6)))
def test_a_front_is_what_nothing_dominates(points):
    front = set(pareto_front(points).tolist())
    for i, p in enumerate(points):
        better = ((points <= p).all(axis=1) & (points < p).any(axis=1)).any()
        same_before = (points[:i] == p).all(axis=1).any()
        assert (i in front) == (not better and not same_before)


def test_points_are_spread_with_both_ends():
    x = np.linspace(0.0, 1.0, 11)
    line = np.stack([x, 1.0 - x], axis=1)
    assert spread_along(line, 3).tolist() == [0, 5, 10]
    assert spread_along(line, 1).tolist() == [5]
    assert spread_along(line, 20).tolist() == list(range(11))
    crowded = np.stack([np.append(x / 100.0, 1.0), np.append(1.0 - x / 100.0, 0.0)], axis=1)
    assert spread_along(crowded, 4).tolist()[-1] == 11
    assert len(set(spread_along(crowded, 4).tolist())) == 4
    with pytest.raises(ConfigurationError, match="at least 1"):
        spread_along(line, 0)


def test_the_unit_of_a_rate_does_not_matter_to_the_spread():
    x = np.linspace(0.0, 1.0, 8) ** 2
    line = np.stack([x, 1.0 - np.sqrt(x)], axis=1)
    assert (spread_along(line, 4) == spread_along(line * [1.0, 1e-6], 4)).all()


def test_points_with_falls_are_kept_only_if_nothing_else_is_there():
    points = np.array([[0.0, 0.0], [2.0, 1.0], [1.0, 2.0]])
    assert chosen(points, np.array([True, False, False]), 5).tolist() == [2, 1]
    assert chosen(points, np.array([True, True, True]), 5).tolist() == [0]
    assert chosen(np.full((2, 2), np.nan), np.zeros(2, dtype=bool), 5).tolist() == []


def test_interpolation_runs_through_the_points_and_never_beyond():
    points = np.array([[0.2, 1.0], [0.1, 2.0], [0.4, 0.0], [0.1, 9.0]])
    values = interpolated(points, np.array([0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5]))
    np.testing.assert_allclose(values, [np.nan, 2.0, 1.5, 1.0, 0.5, 0.0, np.nan], atol=1e-12)


def test_interpolation_of_many_fronts_is_that_of_each():
    rng = np.random.default_rng(0)
    fronts, levels = rng.random((3, 4, 5, 2)), np.linspace(0.2, 0.8, 4)
    every = interpolated(fronts, levels)
    assert every.shape == (3, 4, 4)
    np.testing.assert_array_equal(every[2, 1], interpolated(fronts[2, 1], levels))


def test_what_are_no_pairs_is_refused():
    with pytest.raises(ConfigurationError, match="pairs of rates"):
        pareto_front(np.zeros((3, 3)))
