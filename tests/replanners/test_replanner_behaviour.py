"""What holds for every replanner. A new one joins by its entry in ``conftest.named``."""

import json

import numpy as np
import pytest

from lmtr.errors import DataError
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT
from lmtr.vectors.segment_vector import decode_segment


@pytest.fixture
def replanner(named):
    return named[1]


@pytest.fixture
def tasks(walk_segments):
    """A hundred tasks near those of the expert, none of them among them."""
    rng = np.random.default_rng(7)
    rows = walk_segments.x[rng.integers(0, len(walk_segments.x), 100)]
    return rows + 0.05 * walk_segments.x.std(axis=0) * rng.standard_normal(rows.shape)


def test_plans_are_segments_that_decode(replanner, tasks):
    tau = replanner.plan(tasks)
    assert tau.shape == (100, SEGMENT_LAYOUT.size)
    assert tau.dtype == np.float64
    assert decode_segment(tau).is_finite().all()


def test_the_same_task_gets_the_same_plan(replanner, tasks):
    np.testing.assert_array_equal(replanner.plan(tasks), replanner.plan(tasks))


def test_a_plan_does_not_depend_on_its_company(replanner, tasks):
    together = replanner.plan(tasks)
    alone = np.concatenate([replanner.plan(tasks[i : i + 1]) for i in range(len(tasks))])
    np.testing.assert_allclose(together, alone, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(replanner.plan(tasks[::-1]), together[::-1], rtol=0.0, atol=1e-6)


def test_tasks_are_not_changed(replanner, tasks):
    before = tasks.copy()
    replanner.plan(tasks)
    np.testing.assert_array_equal(tasks, before)


def test_no_task_makes_no_plan(replanner, tasks):
    assert replanner.plan(tasks[:0]).shape == (0, SEGMENT_LAYOUT.size)


@pytest.mark.parametrize("shape", [(TASK_LAYOUT.size,), (4, TASK_LAYOUT.size - 1), (1, 1, 35)])
def test_tasks_of_another_shape_are_refused(replanner, shape):
    with pytest.raises(DataError, match="35"):
        replanner.plan(np.zeros(shape))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_tasks_that_are_not_finite_are_refused_by_field(replanner, tasks, value):
    tasks[3, TASK_LAYOUT.slice("goal_position")] = value
    with pytest.raises(DataError, match="goal_position"):
        replanner.plan(tasks)


def test_name_footprint_and_description(named):
    name, replanner = named
    assert replanner.name == name
    assert replanner.nbytes > 0
    assert json.loads(json.dumps(replanner.describe()))["replanner"] == name
