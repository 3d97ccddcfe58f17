"""Sums of one rollout, and the rates that are made of them."""

from dataclasses import replace

import numpy as np
import pytest

from lmtr.robot.model import ANYMAL, GRAVITY
from lmtr.rollout.record import Ending, Rollout
from lmtr.rollout.settings import Criteria
from lmtr.rollout.summary import pooled, residual_percentiles, summarise
from lmtr.rollout.tally import NAMES, RATES, Tally


@pytest.fixture
def rollout(standing):
    """Rollouts of three cycles of 0.3 s on the spot, without lines."""

    def make(index=0, ending=Ending.COMPLETED, jump=0.1):
        return Rollout(
            replanner="made by hand",
            seed=0,
            index=index,
            motion=standing(samples=10),
            obstacles_W=np.zeros((0, 3)),
            ending=ending,
            velocity_jump=np.array([0.0, jump, 2.0 * jump]),
            foot_jump=np.full((3, 4), 0.02),
            disagreements=np.zeros((3, 4), dtype=np.int8),
            plan_seconds=np.full(3, 1e-3),
        )

    return make


def test_sums_of_a_rollout_known_by_hand(rollout):
    made = rollout(ending=Ending.TILT)
    made.motion.foot_force_W[4, 1, 2] = -0.25 * ANYMAL.weight
    tally = Tally.of_rollout(made, ANYMAL, Criteria())
    assert (tally.motions, tally.falls) == (1.0, 1.0)
    assert (tally.replannings, tally.foot_replannings) == (3.0, 12.0)
    assert tally.velocity_jump == pytest.approx(0.3)
    assert tally.foot_jump == pytest.approx(0.24)
    assert (tally.contacts, tally.friction_violations, tally.pulls) == (40.0, 1.0, 1.0)
    assert tally.friction_excess == pytest.approx(0.25)
    assert tally.balances == 8.0
    # Half a weight is missing at one sample: 1/6, 4/6 and 1/6 of it in three means.
    assert tally.linear_residual == pytest.approx(0.5 * 9.81)
    assert tally.duration == pytest.approx(0.9)


@pytest.mark.parametrize(("pull", "counted"), [(0.004, 0.0), (0.006, 9.0)])
def test_what_is_within_the_tolerance_does_not_count(rollout, pull, counted):
    """It is no violation, but still part of how far forces are outside on average."""
    made = rollout()
    made.motion.foot_force_W[1:, 0, 2] = -pull * ANYMAL.weight
    tally = Tally.of_rollout(made, ANYMAL, Criteria(friction_excess=0.005))
    assert (tally.friction_violations, tally.pulls) == (counted, counted)
    found = pooled([tally])
    assert found.pull_share.value == pytest.approx(counted / 40.0)
    assert found.mean_friction_excess.value == pytest.approx(9.0 * pull / 40.0)


def test_who_slides_does_not_pull(rollout):
    made = rollout()
    made.motion.foot_force_W[3, 2, 0] = 0.5 * ANYMAL.weight
    tally = Tally.of_rollout(made, ANYMAL, Criteria())
    assert (tally.friction_violations, tally.pulls) == (1.0, 0.0)
    assert tally.friction_excess == pytest.approx(0.5 - 0.25 * ANYMAL.friction)


def test_upper_ends_of_residuals_are_over_the_samples_of_all_rollouts(rollout):
    """One rollout of ten lacks 0.4 of its weight throughout."""
    made = [rollout(index) for index in range(10)]
    made[3].motion.foot_force_W[:] *= 0.6
    found = summarise(made, ANYMAL)
    # A tenth of 80 samples has 0.4 g: so has the 95th percentile. The mean is a tenth of it.
    assert found.linear_residual_p95 == pytest.approx(0.4 * GRAVITY)
    assert found.performance.linear_residual.value == pytest.approx(0.04 * GRAVITY)
    assert found.angular_residual_p95 == pytest.approx(0.0, abs=1e-9)
    # Of a fiftieth it does not.
    few = [rollout(index) for index in range(50)]
    few[3].motion.foot_force_W[:] *= 0.6
    assert summarise(few, ANYMAL).linear_residual_p95 == pytest.approx(0.0, abs=1e-9)
    assert np.isnan(residual_percentiles([(np.zeros(0), np.zeros(0))])).all()


def test_sums_of_before_are_nan_and_not_zero(rollout):
    sums = Tally.of_rollout(rollout(), ANYMAL, Criteria()).as_dict()
    del sums["pulls"]
    assert np.isnan(Tally.from_dict(sums).pulls)


def test_a_motion_by_itself_has_no_replannings(standing):
    tally = Tally.of(standing(), np.zeros((0, 3)), ANYMAL, Criteria())
    assert (tally.replannings, tally.velocity_jump, tally.falls) == (0.0, 0.0, 0.0)
    found = pooled([tally])
    assert np.isnan(found.mean_velocity_jump.value)
    assert found.linear_residual.value == pytest.approx(0.0, abs=1e-9)


def test_mean_jumps_are_over_all_replannings_with_intervals(rollout):
    made = [rollout(index, jump=0.1 * (index + 1)) for index in range(4)]
    found = summarise(made, ANYMAL).performance
    assert found.mean_velocity_jump.value == pytest.approx(0.25)
    assert found.mean_velocity_jump.low < 0.25 < found.mean_velocity_jump.high
    assert found.mean_foot_jump.low == pytest.approx(0.02)


def test_no_fall_in_a_hundred_is_not_certainty(rollout):
    """Clopper and Pearson: 1 − 0.025^(1/100) for none in a hundred."""
    made = [rollout(index) for index in range(100)]
    share = summarise(made, ANYMAL).performance.fall_share
    assert (share.value, share.low) == (0.0, 0.0)
    assert share.high == pytest.approx(1.0 - 0.025 ** (1.0 / 100.0))
    made[7] = replace(made[7], ending=Ending.SPEED)
    share = summarise(made, ANYMAL).performance.fall_share
    assert share.value == pytest.approx(0.01)
    assert 0.0 < share.low < 0.01 < share.high


def test_tallies_go_through_plain_numbers(rollout):
    tally = Tally.of_rollout(rollout(), ANYMAL, Criteria())
    assert Tally.from_dict(tally.as_dict()) == tally
    assert {part for pair in RATES.values() for part in pair} <= set(NAMES)
