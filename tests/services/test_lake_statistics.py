"""Statistics agree with NumPy's over all rows at once; draws are the same for the same seed."""

import numpy as np
import pytest

from services.lake import statistics
from services.lake.statistics import QUANTILES, column_statistics, sample


def test_vectors_have_statistics_by_entry(lake, segments):
    rng = np.random.default_rng(3)
    x, tau = 1e3 + rng.normal(size=(1000, 35)), rng.normal(size=(1000, 264))
    lake.append("segments", segments(x, tau), app_id="x", number=1)
    found = column_statistics(lake, "segments", columns=["x"])
    seen = x.astype(np.float32).astype(float)
    assert [each.entry for each in found] == [str(k) for k in range(35)]
    for figure, expected in (
        ("least", seen.min(axis=0)),
        ("greatest", seen.max(axis=0)),
        ("mean", seen.mean(axis=0)),
        ("deviation", seen.std(axis=0)),
        ("quantiles", np.quantile(seen, QUANTILES, axis=0).T),
    ):
        got = np.array([getattr(each, figure) for each in found])
        np.testing.assert_allclose(got, expected, rtol=1e-12)
    assert {each.count for each in found} == {1000}


def test_names_conditions_and_nulls(lake, solutions):
    lake.append("solutions", solutions([0, 1, 2], expected_cost=None), app_id="x", number=1)
    wanted = ["status", "cost", "expected_cost", "accepted", "violations"]
    found = column_statistics(lake, "solutions", '"index" > 0', wanted)
    by_name = {(each.column, each.entry): each for each in found}
    assert by_name["cost", ""].as_record()["q50"] == 2.5
    assert (by_name["expected_cost", ""].count, by_name["expected_cost", ""].nulls) == (0, 2)
    assert by_name["accepted", ""].mean == 1.0
    assert (by_name["status", ""].count, by_name["status", ""].mean) == (2, None)
    assert by_name["violations", "drift"].mean == pytest.approx(1e-3)
    assert by_name["violations", "swing_shortest"].not_finite == 2


def test_quantiles_of_a_large_table_come_from_an_even_draw(lake, segments, monkeypatch):
    monkeypatch.setattr(statistics, "KEPT_ROWS", 2000)
    values = np.linspace(0.0, 1.0, 10_000)
    x = np.broadcast_to(values[:, None], (10_000, 35))
    lake.append("segments", segments(x, np.zeros((10_000, 264))), app_id="x", number=1)
    first = column_statistics(lake, "segments", columns=["x"])[0]
    np.testing.assert_allclose(first.quantiles, QUANTILES, atol=0.05)
    assert (first.count, first.greatest) == (10_000, 1.0)


def test_a_draw_depends_on_seed_and_identity_alone(lake, solutions):
    for number in range(1, 6):
        rows = solutions([5 * number + k for k in range(5)])
        lake.append("solutions", rows, app_id="x", number=number)
    drawn = [sample(lake, "solutions", 6, seed=s)["index"].to_pylist() for s in (0, 0, 1)]
    assert drawn[0] == drawn[1] != drawn[2]
    lake.compact("solutions")
    assert sample(lake, "solutions", 6)["index"].to_pylist() == drawn[0]
    assert set(sample(lake, "solutions", 99, "cost > 20")["index"].to_pylist()) == set(
        range(20, 30)
    )
