"""Bounds never exceed what they bound, whatever the rows look like."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lmtr.policies.distance_bounds import GROUPS, TILE, DistanceBounds, signed_sums


@given(
    seed=st.integers(0, 2**32 - 1),
    rows=st.integers(1, 80),
    columns=st.integers(1, 40),
    factors=st.integers(1, 5),
    scale=st.sampled_from([0.0, 1e-6, 1.0, 1e4]),
    outlier=st.sampled_from([0.0, 1.0, 1e3]),
)
def test_no_row_has_a_bound_beyond_its_distance(seed, rows, columns, factors, scale, outlier):
    rng = np.random.default_rng(seed)
    common = rng.standard_normal((factors, columns))
    library = scale * (rng.standard_normal((rows, factors)) @ common)
    library[0] += outlier
    queries = 2.0 * scale * (rng.standard_normal((5, factors)) @ common) + rng.normal(0, 3, columns)
    library, queries = library.astype(np.float32), queries.astype(np.float32)
    bounds = DistanceBounds(library)
    for query in queries:
        distances = np.abs(library.astype(float) - query).sum(axis=1)
        found = bounds.of(query)
        assert (found >= 0).all()
        assert all(
            bound <= bounds.highest(distance)
            for bound, distance in zip(found, distances, strict=True)
        )


def test_bounds_are_close_where_dimensions_vary_together():
    rng = np.random.default_rng(0)
    walking = rng.standard_normal((TILE + 500, 6)) @ rng.standard_normal((6, 35))
    rows = (walking + 0.02 * rng.standard_normal(walking.shape)).astype(np.float32)
    bounds, query = DistanceBounds(rows), rows[7] + np.float32(0.01)
    nearest = np.sort(np.abs(rows - query).sum(axis=1))[1]
    passing = (bounds.of(query) <= bounds.highest(nearest)).sum()
    assert 2 <= passing < 0.01 * len(rows)


@pytest.mark.parametrize("columns", [1, GROUPS, 35])
def test_every_dimension_is_in_one_group(columns):
    rows = np.random.default_rng(1).standard_normal((50, columns)).astype(np.float32)
    signs = signed_sums(rows, GROUPS)
    assert signs.shape == (columns, min(columns, GROUPS))
    np.testing.assert_array_equal(np.abs(signs).sum(axis=1), 1.0)
