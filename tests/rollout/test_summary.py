"""Aggregate performance, its intervals, and that diverged rollouts are never hidden."""

from dataclasses import replace

import numpy as np
import pytest

from lmtr.errors import DataError
from lmtr.robot.model import ANYMAL
from lmtr.rollout.contacts import Disagreement
from lmtr.rollout.courses import random_courses
from lmtr.rollout.record import Ending
from lmtr.rollout.settings import Criteria
from lmtr.rollout.starts import draw_starts
from lmtr.rollout.summary import performance, summarise
from lmtr.rollout.testbed import run_rollouts


@pytest.fixture(scope="module")
def rollouts(library, short):
    courses = random_courses(short, 2, range(12))
    return run_rollouts(library, courses, draw_starts(library.tau, courses), short, ANYMAL)


def test_a_summary_of_equal_rollouts_has_no_uncertainty(rollouts):
    found = performance([(rollouts[0].motion, rollouts[0].obstacles_W)] * 5, ANYMAL)
    for estimate in (found.mean_violation, found.speed, found.distance):
        assert estimate.low == pytest.approx(estimate.value)
        assert estimate.high == pytest.approx(estimate.value)
    x = rollouts[0].motion.base_position_W[:, 0]
    assert found.distance.value == pytest.approx(x[-1] - x[0])
    assert found.speed.value == pytest.approx((x[-1] - x[0]) / rollouts[0].end_time)


def test_intervals_enclose_the_value_and_repeat(rollouts):
    found, again = summarise(rollouts, ANYMAL), summarise(rollouts, ANYMAL)
    assert found == again
    for name in ("close_share", "mean_violation", "distance", "speed"):
        estimate = getattr(found.performance, name)
        assert estimate.low < estimate.value < estimate.high, name


def test_intervals_are_those_of_the_normal_distribution(rollouts):
    """Of 400 walks with a spread of 0.1 m: ±1.96·0.1/√400."""
    motion, rng = rollouts[0].motion, np.random.default_rng(0)

    def walked(distance):
        path = motion.base_position_W.copy()
        path[:, 0] = np.linspace(0.0, distance, len(path))
        return replace(motion, base_position_W=path)

    motions = [(walked(distance), np.zeros((0, 3))) for distance in rng.normal(1.0, 0.1, 400)]
    found = performance(motions, ANYMAL).distance
    assert found.high - found.low == pytest.approx(2 * 1.96 * 0.1 / 20.0, rel=0.15)


def test_diverged_rollouts_are_counted_with_their_reason(rollouts):
    ended = [replace(rollouts[0], ending=Ending.TILT), replace(rollouts[1], ending=Ending.TILT)]
    failed = replace(rollouts[2], ending=Ending.NOT_FINITE)
    found = summarise([*ended, failed, *rollouts[3:]], ANYMAL)
    before = sum(rollout.diverged for rollout in rollouts[3:])
    assert found.diverged == 3 + before
    assert found.reasons[Ending.TILT] >= 2
    assert found.performance.motions == 12


def test_continuity_figures_are_those_of_the_records(rollouts):
    found = summarise(rollouts, ANYMAL)
    kinds = np.concatenate([r.disagreements.ravel() for r in rollouts])
    assert found.disagreement_share == pytest.approx((kinds != 0).mean())
    assert sum(found.disagreements.values()) == (kinds != 0).sum()
    assert found.disagreements[Disagreement.LANDS_LATE] == (kinds == 3).sum()
    assert found.velocity_jump == np.median(np.concatenate([r.velocity_jump for r in rollouts]))


def test_stricter_criteria_find_more(rollouts):
    loose = summarise(rollouts, ANYMAL).performance
    strict = summarise(rollouts, ANYMAL, Criteria(clearance=0.1, forward_limit=0.15)).performance
    assert strict.close_share.value > loose.close_share.value
    assert strict.mean_violation.value > loose.mean_violation.value


def test_nothing_crossed_is_not_a_perfect_score(rollouts):
    found = performance([(rollouts[0].motion, np.zeros((0, 3)))], ANYMAL)
    assert found.obstacles_crossed == 0
    assert np.isnan(found.close_share.value)


def test_rollouts_of_several_replanners_are_refused(rollouts):
    with pytest.raises(DataError, match="one replanner"):
        summarise([rollouts[0], replace(rollouts[1], replanner="other")], ANYMAL)
    with pytest.raises(DataError, match="one replanner"):
        summarise([], ANYMAL)
    with pytest.raises(DataError, match="at least one motion"):
        performance([], ANYMAL)
