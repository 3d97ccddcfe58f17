"""The study of thresholds says what each refuses, suggests leniently, and sees what is hard."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.filtering.costs import by_difficulty, compare_draws
from benchmarks.filtering.removal import removals, saturation, suggestions, two_digits
from benchmarks.filtering.solves import Amount, Kind, Solve, costs, of_kind, read, write
from benchmarks.solving.circumstances import circumstances
from lmtr.errors import DataError
from lmtr.quality.cost_model import CostModel
from lmtr.quality.filter import QualityThresholds
from lmtr.quality.measure import Violations

LIMITS = QualityThresholds()
MODEL = CostModel(
    robot="anymal",
    cost_key="key",
    typical=1.0,
    intercept=1.0,
    distance_fourth=0.5,
    lateral=0.0,
    yaw=0.0,
    lines=0.0,
    scatter=0.0,
)
STILL = dict.fromkeys(
    [name for name in Violations.__dataclass_fields__ if name != "closest_footholds"], 0.0
)
SOUND = STILL | {"stance_shortest": 0.3, "swing_shortest": 0.3, "fewest_feet_down": 3.0}


def solve(kind=Kind.DEFAULT, index=0, draw=0, excess=0.0, distance=2.0, saturated=(), **figures):
    features = (distance**2, 0.0, 0.0, 2.0, 0.0)
    cost = float(MODEL.predict(np.array(features))) * (1.0 + excess)
    return Solve(
        str(kind), index, draw, "converged", cost, distance, 2, features, saturated, SOUND | figures
    )


def test_shares_are_counted_alone_and_beside_other_reasons():
    solves = [
        solve(tilt=1.0),
        solve(tilt=1.0, drift=1.0),
        solve(tilt=1.0, saturated=("height",)),
        *[solve() for _ in range(7)],
    ]
    expected = MODEL.predict(np.array([s.features for s in solves]))
    found = {each.rule.figure: each for each in removals(solves, LIMITS, expected)}
    assert (found["tilt"].alone, found["tilt"].additional) == (0.3, 0.1)
    assert (found["drift"].alone, found["drift"].additional) == (0.1, 0.0)
    assert found["cost_excess"].alone == 0.0
    assert found["tilt"].has_distribution
    assert not found["pull"].has_distribution
    assert saturation(solves) == {"saturated:height": 0.1}


def test_the_group_that_needs_more_decides_what_is_suggested():
    calm = [solve(vertical_speed=0.1 + 0.001 * k, closest_foothold_1=0.2) for k in range(100)]
    vigorous = [solve(vertical_speed=0.3 + 0.001 * k, closest_foothold_1=0.1) for k in range(100)]
    suggested = suggestions([calm, vigorous], 0.95)
    assert suggested["vertical_speed"] == 0.4
    assert suggested["obstacle_clearance"] == pytest.approx(0.1)
    assert suggestions([calm], 0.95)["vertical_speed"] == 0.2
    assert "phase_shortest" not in suggested
    assert "friction_excess" not in suggested


@pytest.mark.parametrize(
    ("value", "up", "down"), [(0.1234, 0.13, 0.12), (4.61, 4.7, 4.6), (-0.3, -0.3, -0.3)]
)
def test_two_digits(value, up, down):
    assert two_digits(value, up=True) == up
    assert two_digits(value, up=False) == down


def test_a_raw_threshold_refuses_what_is_far_and_a_conditional_one_what_is_dear():
    rng = np.random.default_rng(1)
    solves = [
        solve(distance=d, excess=e)
        for d in (1.0, 2.0, 2.5, 3.5)
        for e in 0.05 * rng.standard_normal(50)
    ]
    refused = np.zeros(len(solves), dtype=bool)
    by_distance, by_lines = by_difficulty(solves, MODEL, 0.8, refused)
    assert by_distance.names == ["0.5–1.5", "1.5–2.3", "2.3–2.7", "3.1–3.6"]
    assert by_distance.raw[:3] == [0.0, 0.0, 0.0]
    assert by_distance.raw[3] > 0.7
    assert max(by_distance.conditional) < 0.4
    assert (by_lines.names, by_lines.counts, by_lines.filtered) == (["2"], [200], [0.0])


def test_draws_are_compared_with_the_best_of_their_own_task():
    solves = [
        solve(Kind.DRAWS, index, draw, excess=0.2 * draw, distance=1.0 + index)
        for index in range(3)
        for draw in range(3)
    ]
    draws = compare_draws(solves, MODEL)
    np.testing.assert_allclose(draws.over_best, np.tile([0.0, 0.2, 0.4], 3), atol=1e-12)
    assert draws.correlation == pytest.approx(1.0)
    assert draws.ranking(draws.over_expected) == 1.0
    assert draws.ranking(draws.raw) < 1.0
    assert draws.precision(0.1) == 1.0
    assert np.isnan(draws.precision(0.9))
    assert draws.between == pytest.approx(0.0, abs=1e-12)


def test_solves_are_kept_as_they_were(tmp_path):
    solves = [solve(saturated=("window",), closest_foothold_1=0.2), solve(Kind.VARIED, 1)]
    made = circumstances({}, 0, 2, compiled=True)
    write(tmp_path / "solves.json", made, "key", solves)
    assert read(tmp_path / "solves.json") == (made, "key", solves)
    with pytest.raises(DataError, match="does not exist"):
        read(tmp_path / "none.json")


def test_only_converged_solves_of_a_kind_are_taken():
    failed = replace(solve(), status="diverged")
    solves = [solve(), failed, solve(Kind.VARIED)]
    assert of_kind(solves, Kind.DEFAULT) == solves[:1]
    assert len(costs(of_kind(solves, Kind.DEFAULT, Kind.VARIED))) == 2


def test_all_kinds_are_solved_in_their_amounts():
    jobs = list(Amount(default=2, varied=1, repeated=2, draws=3).jobs())
    assert len(jobs) == len(set(jobs)) == 2 + 1 + 2 * 3
    assert sum(kind is Kind.DRAWS for kind, _, _ in jobs) == 6
