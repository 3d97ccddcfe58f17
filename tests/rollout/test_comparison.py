"""Ratios of replanners with known answers, and intervals that cover as often as they say."""

import numpy as np
import pytest

from lmtr.errors import DataError
from lmtr.rollout.comparison import (
    Tallies,
    at_equal_avoidance,
    common_levels,
    least_share,
    ratio,
)
from lmtr.rollout.tally import NAMES


def tallies(violation, close=None, contacts=100.0):
    """Of sums of violation (S, C) and, if given, of close steps; 10 steps on each course."""
    violation = np.atleast_2d(np.asarray(violation, dtype=float))
    sums = {name: np.ones(violation.shape) for name in NAMES}
    sums["contacts"] = np.full(violation.shape, contacts)
    sums["steps"] = np.full(violation.shape, 10.0)
    sums["violation"] = violation
    sums["close_steps"] = np.zeros(violation.shape) if close is None else np.atleast_2d(close)
    return Tallies(sums)


def test_a_ratio_of_proportional_courses_is_certain():
    """B is half of A on every course: whichever are drawn, the ratio is 2."""
    hard = np.random.default_rng(0).random(30)
    found = ratio(tallies(hard), tallies(hard / 2.0), "mean_violation")
    assert (found.value, found.low, found.high) == pytest.approx((2.0, 2.0, 2.0))
    unpaired = ratio(tallies(hard), tallies(hard[::-1] / 2.0), "mean_violation")
    assert unpaired.low < 1.9
    assert unpaired.high > 2.1


def test_several_training_seeds_are_drawn_too():
    """Courses are alike: all uncertainty is that of the seeds."""
    seeds = np.array([[1.0], [2.0], [3.0]]) * np.ones((3, 20))
    found = ratio(tallies(seeds), tallies(np.ones(20)), "mean_violation")
    assert found.value == pytest.approx(2.0)
    assert (found.low, found.high) == pytest.approx((1.0, 3.0), abs=0.34)
    pooled = ratio(tallies(seeds[1:2]), tallies(np.ones(20)), "mean_violation")
    assert pooled.low == pooled.high == pytest.approx(2.0)


def test_intervals_cover_the_truth_as_often_as_they_say():
    """Of 200 studies with 40 courses each, about 95 % hold the true ratio of 2."""
    rng, held = np.random.default_rng(1), 0
    for study in range(200):
        course = rng.gamma(4.0, size=40)
        a, b = 2.0 * course * rng.gamma(4.0, size=40), course * rng.gamma(4.0, size=40)
        found = ratio(tallies(a), tallies(b), "mean_violation", seed=study)
        held += found.low <= 2.0 <= found.high
    assert 175 <= held <= 199


def test_ratios_by_nothing_are_bounds():
    some, none = tallies(np.ones(10)), tallies(np.zeros(10))
    found = ratio(some, none, "mean_violation")
    assert (found.value, found.low, found.at_least) == (np.inf, np.inf, True)
    bound = ratio(some, none, "mean_violation", resolution=0.001)
    assert (bound.value, bound.at_least) == (pytest.approx(10.0), True)
    nothing = ratio(none, none, "mean_violation")
    assert np.isnan([nothing.value, nothing.low, nothing.high]).all()
    assert not nothing.at_least
    assert ratio(none, some, "mean_violation").value == 0.0


def test_one_course_with_a_violation_leaves_the_upper_end_open():
    """A third of the draws misses B's only violation, and A's with it: nothing is known there."""
    rare = np.zeros(20)
    rare[0] = 1.0
    found = ratio(tallies(rare), tallies(rare), "mean_violation")
    assert (found.value, found.low, found.high) == (1.0, 0.0, np.inf)


def test_sums_that_an_older_evaluation_lacks_are_not_judged():
    """An evaluation of before is compared by what it has, and by nothing else."""
    row = dict.fromkeys(NAMES, 1.0)
    old = {name: value for name, value in row.items() if name not in ("friction_excess", "pulls")}
    mixed, new = Tallies.stacked([[old, row]]), Tallies.stacked([[row, row]])
    assert mixed.rate("mean_violation") == 1.0
    assert ratio(mixed, new, "mean_violation").value == 1.0
    assert np.isnan(mixed.rate("pull_share"))
    found = ratio(mixed, new, "mean_friction_excess")
    assert np.isnan([found.value, found.low, found.high]).all()
    assert not found.at_least


def test_the_least_share_follows_the_rule_of_three():
    assert least_share(tallies(np.ones(30)), "close_share") == pytest.approx(3.0 / 300.0)


def test_equal_avoidance_of_hand_made_fronts():
    """A's violation is 3 − 10·(share), B's a third of it, at different w's."""
    courses = np.ones(15)

    def front(shares, factor):
        return [
            tallies(100.0 * factor * (3.0 - 10.0 * s) * courses, 10.0 * s * courses) for s in shares
        ]

    a, b = front([0.0, 0.1, 0.2], 1.0), front([0.05, 0.12, 0.25], 1.0 / 3.0)
    levels = common_levels(a, b, 4)
    np.testing.assert_allclose(levels, [0.05, 0.1, 0.15, 0.2])
    for found in at_equal_avoidance(a, b, levels[1:3]):
        expected = 3.0 - 10.0 * found.close_share
        assert found.a.value == pytest.approx(expected)
        assert found.b.value == pytest.approx(expected / 3.0)
        assert found.ratio.value == pytest.approx(3.0)
        assert found.ratio.low == pytest.approx(found.ratio.high)
        assert found.covered == 1.0
    beyond = at_equal_avoidance(a, b, np.array([0.24]))[0]
    assert np.isnan([beyond.a.value, beyond.ratio.value, beyond.ratio.low]).all()
    assert beyond.covered == 0.0
    assert len(common_levels(front([0.0, 0.1], 1.0), front([0.2, 0.3], 1.0))) == 0


def test_intervals_along_the_front_enclose_and_repeat():
    rng = np.random.default_rng(3)
    course = rng.gamma(3.0, size=40)

    def front(shares, factor, seeds):
        made = []
        for share in shares:
            close = rng.binomial(10, share, size=(seeds, 40)).astype(float)
            noise = rng.gamma(20.0, 0.05, size=(seeds, 40))
            made.append(tallies(factor * (0.5 - share) * course * noise, close))
        return made

    a, b = front([0.02, 0.2, 0.4], 5.0, 1), front([0.05, 0.2, 0.3], 1.0, 3)
    found, again = (at_equal_avoidance(a, b, np.array([0.15, 0.25]), seed=4) for _ in range(2))
    assert found == again
    for each in found:
        assert each.covered > 0.9
        assert each.ratio.low < each.ratio.value < each.ratio.high
        assert each.ratio.low < 5.0 < each.ratio.high


def test_replanners_that_walked_different_courses_are_refused():
    with pytest.raises(DataError, match="same courses"):
        ratio(tallies(np.ones(3)), tallies(np.ones(4)), "mean_violation")
    one, other = (
        Tallies(tallies(np.ones(3)).sums, tuple((seed, index) for index in range(3)))
        for seed in (0, 1)
    )
    assert ratio(one, one, "mean_violation").value == 1.0
    with pytest.raises(DataError, match="same courses"):
        ratio(one, other, "mean_violation")
    with pytest.raises(DataError, match="same courses"):
        at_equal_avoidance([], [tallies(np.ones(4))], np.array([0.1]))
    with pytest.raises(DataError, match="same courses"):
        Tallies.stacked([[], []])
