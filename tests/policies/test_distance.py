"""Weights of the task distance."""

import pytest
from pydantic import ValidationError

from lmtr.errors import ConfigurationError
from lmtr.policies.distance import TaskWeights
from lmtr.vectors.layout import TASK_LAYOUT


def test_each_category_gets_its_weight():
    parts = TASK_LAYOUT.unpack(TaskWeights.of([1.0, 2.0, 5.0, 0.5]).expanded())
    assert parts["height"] == 1.0
    assert (parts["angular_velocity"] == 1.0).all()
    assert (parts["RH_position"] == 2.0).all()
    assert (parts["next_lines"] == 5.0).all()
    assert (parts["goal_heading"] == 0.5).all()


def test_fields_and_categories_are_the_same():
    assert tuple(TaskWeights.model_fields) == TASK_LAYOUT.categories


@pytest.mark.parametrize("values", [[1.0], [1.0] * 5, []])
def test_a_list_of_another_length_is_refused(values):
    with pytest.raises(ConfigurationError, match=rf"4 numbers .*got {len(values)}"):
        TaskWeights.of(values)


@pytest.mark.parametrize("values", [[0.0] * 4, [1.0, -1.0, 1.0, 1.0], [float("inf")] + [1.0] * 3])
def test_weights_that_make_no_distance_are_refused(values):
    with pytest.raises(ValidationError, match=r"task weights must not all be 0|greater|finite"):
        TaskWeights.of(values)
