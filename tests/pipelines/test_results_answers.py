"""Claims and ratios follow from the sums of rollouts by their stated rules."""

import numpy as np
import pytest

from lmtr.rollout.comparison import Ratio, Tallies
from lmtr.rollout.tally import NAMES
from pipelines.results.blocks import Measure
from pipelines.results.claims import (
    NOT_JUDGED,
    at_least,
    at_most,
    claims_chapter,
    no_worse,
    targets_chapter,
)
from pipelines.results.groups import Group, Groups
from pipelines.results.ratios import BEST, PLAIN, pairs

COURSES = 40
FIRST, SECOND, THIRD = (1.0, 1.0, 1.0, 1.0), (1.0, 1.0, 5.0, 1.0), (1.0, 5.0, 1.0, 1.0)


def group(latent, close, violation_mm, weights=FIRST, policy="nearest", seeds=2, falls=0):
    """A replanner that walks all courses alike, with the given rates."""
    shape = (1 if latent is None else seeds, COURSES)
    sums = {name: np.ones(shape) for name in NAMES}
    sums["steps"] *= 100.0
    sums["close_steps"] = close * sums["steps"]
    sums["contacts"] *= 1000.0
    sums["violation"] = 1e-3 * violation_mm * sums["contacts"]
    sums["large_violations"] = violation_mm * sums["contacts"] / 100.0
    sums["falls"] = np.zeros(shape)
    sums["falls"][0, :falls] = 1.0
    name = "library" if latent is None else f"lmtr-{latent}"
    members = [
        {
            "evaluation_id": f"{name}-{policy}-{weights[2]:g}-{weights[1]:g}-{seed}",
            "summary": {"nbytes": 2e6, "plan_seconds": 1e-4},
        }
        for seed in range(shape[0])
    ]
    return Group(latent, policy, weights, members, Tallies(sums))


def rows_of(chapter):
    return [
        dict(zip(chapter.blocks[0].headers, row.cells, strict=True))
        for row in chapter.blocks[0].rows
    ]


@pytest.mark.parametrize(
    ("value", "low", "verdict"),
    [
        (6.0, 5.1, "yes"),
        (6.0, 4.0, "value yes, interval no"),
        (4.9, 4.0, "no"),
        (np.inf, np.nan, "value yes, interval no"),
        (np.nan, np.nan, NOT_JUDGED),
    ],
)
def test_a_ratio_reaches_a_target_with_its_interval_or_by_itself(value, low, verdict):
    assert at_least(Ratio(value, low, np.inf), 5.0) == verdict


def test_a_share_stays_below_a_limit_with_its_interval_or_by_itself():
    assert at_most(Measure(0.8, 0.5, 0.9), 1.0) == "yes"
    assert at_most(Measure(0.8, 0.5, 1.2), 1.0) == "value yes, interval no"
    assert at_most(Measure(1.8, 1.5, 2.2), 1.0) == "no"
    assert at_most(Measure(float("nan")), 1.0) == NOT_JUDGED


def test_an_interval_around_one_shows_neither_better_nor_worse():
    assert no_worse(Ratio(0.5, 0.3, 0.9)) == "yes, and fewer"
    assert no_worse(Ratio(1.6, 0.4, 7.0)) == "not told apart"
    assert no_worse(Ratio(1.6, 1.2, 2.0)) == "no"
    assert no_worse(Ratio(np.nan, np.nan, np.nan)) == NOT_JUDGED


def test_claims_are_answered_by_ratios_of_the_rates():
    groups = Groups(
        [
            group(0, 0.25, 0.2),
            group(6, 0.10, 0.3),
            group(12, 0.10, 0.3),
            group(None, 0.05, 3.0),
        ],
        FIRST,
    )
    answers = rows_of(claims_chapter(groups))
    assert answers[0]["ratio (×)"].value == pytest.approx(2.5)
    assert answers[0]["verdict"] == "yes"
    assert answers[1]["ratio (×)"].value == pytest.approx(1.0)
    assert answers[1]["verdict"] == "yes"
    assert answers[2]["ratio (×)"].value == pytest.approx(2.0)
    assert answers[2]["verdict"] == "no"


def test_what_was_not_evaluated_is_said_and_not_guessed():
    only = Groups([group(6, 0.1, 0.3)], FIRST)
    for chapter in (claims_chapter(only), targets_chapter(only)):
        answers = rows_of(chapter)
        assert any(row["verdict"] == "not evaluated" for row in answers)
    assert pairs(Groups([], FIRST)) == []


def test_ratio_along_the_fronts_is_that_of_the_violations_there():
    library = [group(None, 0.04, 4.0, FIRST), group(None, 0.12, 2.0, SECOND)]
    mine = [group(6, 0.04, 0.8, FIRST), group(6, 0.12, 0.4, SECOND)]
    (plain,) = [p for p in pairs(Groups([*mine, *library], FIRST)) if p.kind == PLAIN]
    for at in plain.levels["mean_violation"]:
        assert 0.04 - 1e-9 <= at.close_share <= 0.12 + 1e-9
        assert at.ratio.value == pytest.approx(5.0)


def test_a_beaten_w_of_the_library_does_not_raise_its_front():
    library = [group(None, 0.04, 4.0, FIRST), group(None, 0.12, 2.0, SECOND)]
    beaten = group(None, 0.08, 40.0, THIRD)
    mine = [group(6, 0.04, 0.8, FIRST), group(6, 0.12, 0.4, SECOND)]
    without, with_beaten = (
        next(p for p in pairs(Groups([*mine, *some], FIRST)) if p.kind == PLAIN)
        for some in (library, [*library, beaten])
    )
    assert with_beaten.levels == without.levels


def test_the_best_lmtr_steps_no_closer_than_the_library_and_never_falls():
    library = [group(None, 0.08, 3.0)]
    milder_but_closer, fallen = group(3, 0.20, 0.1), group(12, 0.05, 0.1, falls=1)
    best = group(6, 0.06, 0.5, policy="selected")
    groups = Groups([milder_but_closer, best, fallen, *library], FIRST)
    (pair,) = [p for p in pairs(groups) if p.kind == BEST]
    (at,) = pair.levels["mean_violation"]
    assert at.close_share == pytest.approx(0.08)
    assert at.ratio.value == pytest.approx(6.0)
    assert set(pair.ids) == {*library[0].ids, *best.ids}


def test_rates_pool_seeds_and_have_their_interval():
    both = group(6, 0.1, 0.3)
    both.tallies.sums["close_steps"][1] *= 3.0
    found = both.rate("close_share")
    assert found.value == pytest.approx(0.2)
    assert both.by_seed("close_share") == pytest.approx([0.1, 0.3])
    # With two seeds and courses alike, draws of one seed alone are the ends.
    assert (found.low, found.high) == pytest.approx((0.1, 0.3))
