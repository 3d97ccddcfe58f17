"""The exact index against brute force, ties included."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lmtr.errors import DataError
from lmtr.policies.distance import TaskWeights
from lmtr.policies.nearest_neighbour import TaskIndex
from lmtr.vectors.layout import TASK_LAYOUT
from lmtr.vectors.scaling import Standardiser

UNIT = Standardiser(TASK_LAYOUT, np.zeros(TASK_LAYOUT.size), np.ones(TASK_LAYOUT.size))


def brute_force(
    library: np.ndarray, x: np.ndarray, weights: np.ndarray, k: int
) -> tuple[np.ndarray, np.ndarray]:
    distances = (weights * np.abs(x[:, None, :] - library[None, :, :])).sum(axis=-1)
    order = np.argsort(distances, axis=1, kind="stable")[:, :k]
    return np.take_along_axis(distances, order, axis=1), order


@given(
    seed=st.integers(0, 2**32 - 1),
    rows=st.integers(1, 60),
    levels=st.integers(1, 4),
    weights=st.tuples(*[st.sampled_from([0.0, 0.5, 1.0, 4.0])] * 4).filter(any),
    data=st.data(),
)
def test_the_index_is_brute_force_with_ties_by_row(seed, rows, levels, weights, data):
    # Few small integers: ties everywhere, and sums that are exact in single precision.
    rng = np.random.default_rng(seed)
    library = rng.integers(0, levels + 1, (rows, TASK_LAYOUT.size)).astype(float)
    x = rng.integers(0, levels + 1, (5, TASK_LAYOUT.size)).astype(float)
    k = data.draw(st.integers(1, rows))
    w = TaskWeights.of(weights)
    distances, indices = TaskIndex(library, w, UNIT).query(x, k)
    expected_distances, expected = brute_force(library, x, w.expanded(), k)
    np.testing.assert_array_equal(distances, expected_distances)
    np.testing.assert_array_equal(indices, expected)


def test_scaled_real_numbers_agree_with_brute_force_too():
    rng = np.random.default_rng(0)
    spread = rng.uniform(0.01, 3.0, TASK_LAYOUT.size)
    library = 5.0 + spread * rng.standard_normal((3000, TASK_LAYOUT.size))
    x = 5.0 + spread * rng.standard_normal((50, TASK_LAYOUT.size))
    scaling, w = Standardiser.fit(TASK_LAYOUT, library), TaskWeights.of([1.0, 1.0, 5.0, 0.5])
    distances, indices = TaskIndex(library, w, scaling).query(x, 3)
    expected_distances, expected = brute_force(
        scaling.apply(library), scaling.apply(x), w.expanded(), 3
    )
    np.testing.assert_allclose(distances, expected_distances, rtol=1e-5)
    np.testing.assert_array_equal(indices, expected)


def test_many_ties_still_give_the_lowest_rows():
    rng = np.random.default_rng(0)
    twins = np.tile(rng.standard_normal(TASK_LAYOUT.size), (40, 1))
    others = 9.0 + rng.standard_normal((20, TASK_LAYOUT.size))
    library = np.concatenate([others, twins])
    _, indices = TaskIndex(library, TaskWeights(), UNIT).query(twins[:2] + 0.01, 3)
    assert indices.tolist() == [[20, 21, 22]] * 2


def test_tasks_that_single_precision_cannot_tell_apart_are_still_ranked():
    # Far away, differences of 1e-6 vanish in the sum; the last of many is the nearest.
    count = 40
    library = np.zeros((count, TASK_LAYOUT.size))
    library[:, TASK_LAYOUT.slice("height")] = 1000.0
    library[:, TASK_LAYOUT.slice("LF_time_since_liftoff")] = 1e-6 * np.arange(count, 0, -1)[:, None]
    _, indices = TaskIndex(library, TaskWeights(), UNIT).query(np.zeros((1, TASK_LAYOUT.size)), 2)
    assert indices.tolist() == [[count - 1, count - 2]]


@pytest.mark.parametrize("category", TASK_LAYOUT.categories)
def test_a_category_of_weight_zero_is_ignored(category):
    rng = np.random.default_rng(1)
    library, x = rng.standard_normal((2, 200, TASK_LAYOUT.size))
    index = TaskIndex(library, TaskWeights(**{category: 0.0}), UNIT)
    changed = x.copy()
    changed[:, TASK_LAYOUT.category_indices()[category]] += 100.0
    for found, expected in zip(index.query(changed, 2), index.query(x, 2), strict=True):
        np.testing.assert_array_equal(found, expected)


def test_every_task_is_nearest_to_itself():
    library = np.random.default_rng(2).standard_normal((300, TASK_LAYOUT.size))
    distances, indices = TaskIndex(library, TaskWeights(), UNIT).query(library)
    assert (distances == 0.0).all()
    np.testing.assert_array_equal(indices[:, 0], np.arange(300))


def test_what_cannot_be_searched_is_refused():
    library = np.random.default_rng(3).standard_normal((10, TASK_LAYOUT.size))
    index = TaskIndex(library, TaskWeights(), UNIT)
    assert len(index) == 10
    with pytest.raises(DataError, match=r"1\.\.10 .* got 11"):
        index.query(library, 11)
    with pytest.raises(DataError, match="at least one"):
        TaskIndex(library[:0], TaskWeights(), UNIT)
    library[:, TASK_LAYOUT.category_indices()["eta"]] = 1.0
    only_eta = TaskWeights.of([0.0, 0.0, 1.0, 0.0])
    with pytest.raises(DataError, match="constant"):
        TaskIndex(library, only_eta, Standardiser.fit(TASK_LAYOUT, library))


def test_a_task_is_looked_up_alone_as_in_company_to_the_last_bit():
    library, x = np.random.default_rng(4).standard_normal((2, 500, TASK_LAYOUT.size))
    index = TaskIndex(library, TaskWeights.of([1.0, 1.0, 5.0, 0.5]), UNIT)
    together = index.query(x, 5)
    for row in range(0, 500, 50):
        alone = index.query(x[row : row + 1], 5)
        for one, many in zip(alone, together, strict=True):
            np.testing.assert_array_equal(one[0], many[row])
