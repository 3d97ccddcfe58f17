"""What all settings refuse, whatever they set."""

import importlib
import pkgutil

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, TypeAdapter, ValidationError

import lmtr
from lmtr.settings import PositiveRange, Settings
from lmtr.task.sampling import TaskDistribution

numbers = st.floats(1e-3, 1e3)


@given(pair=st.tuples(numbers, numbers))
def test_a_range_ascends(pair):
    adapter = TypeAdapter(PositiveRange)
    assert adapter.validate_python(sorted(pair)) == tuple(sorted(pair))
    if pair[0] > pair[1]:
        with pytest.raises(ValidationError, match="must ascend"):
            adapter.validate_python(pair)


@pytest.mark.parametrize("name", ["goal_distance", "first_obstacle", "obstacle_spacing"])
@pytest.mark.parametrize("pair", [(-1.0, -0.5), (0.0, 1.0), (1.0, float("inf")), (0.9, 0.8)])
def test_tasks_lie_ahead_in_the_order_they_are_met(name, pair):
    with pytest.raises(ValidationError, match=name):
        TaskDistribution(**{name: pair})


def test_all_settings_are_frozen_and_refuse_unknown_names():
    for module in pkgutil.walk_packages(lmtr.__path__, "lmtr."):
        importlib.import_module(module.name)

    def below(cls):
        return {cls}.union(*(below(child) for child in cls.__subclasses__()))

    ours = [c for c in below(BaseModel) if c.__module__.startswith("lmtr.")]
    assert len(ours) > 10
    for cls in ours:
        assert issubclass(cls, Settings), cls
        assert (cls.model_config["frozen"], cls.model_config["extra"]) == (True, "forbid"), cls
