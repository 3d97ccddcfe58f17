"""Sums come out of the lake as they went in, and only those of the same courses go together."""

import pytest

from lmtr.errors import DataError
from lmtr.rollout.comparison import ratio
from lmtr.rollout.tally import RATES
from pipelines.tallies import tallies_of
from services.home import Home
from services.lake.tables import Lake


@pytest.fixture(scope="module")
def lake(tiny_home):
    return Lake(Home.open(tiny_home, create=False).lake)


def test_rates_are_those_of_the_summary_and_ratios_by_oneself_are_one(lake):
    rows = lake.read("evaluations").to_pylist()
    for row in rows:
        tallies, summary = tallies_of(lake, [row["evaluation_id"]]), dict(row["summary"])
        assert tallies.shape == (1, 2)
        for name in RATES:
            assert tallies.rate(name) == pytest.approx(summary[name], nan_ok=True), name
        found = ratio(tallies, tallies, "linear_residual")
        assert (found.value, found.low, found.high) == pytest.approx((1.0, 1.0, 1.0))
    several = tallies_of(lake, [row["evaluation_id"] for row in rows[:2]])
    assert several.shape == (2, 2)


def test_what_is_not_there_is_named(lake):
    with pytest.raises(DataError, match="'none' has no sums"):
        tallies_of(lake, ["none"])
