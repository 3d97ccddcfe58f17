"""What happens when a plan and the accumulated motion disagree about a contact."""

import numpy as np
import pytest

from lmtr.rollout.contacts import Disagreement, Feet, schedule
from lmtr.trajectory.trajectory import Trajectory

NEVER = np.inf


def plan_with(times):
    """A segment whose feet all have these contact times."""
    return Trajectory(
        base_start=np.zeros(1),
        base_nodes=np.zeros((1, 9, 2, 6)),
        contact_times=np.broadcast_to(np.array(times), (1, 4, 4)),
        footholds=np.zeros((1, 4, 2, 3)),
        swing_nodes=np.zeros((1, 4, 1, 5)),
        force_nodes=np.zeros((1, 4, 2, 3, 2, 3)),
    )


def feet_that(stand):
    since = np.full((1, 4), 0.0 if stand else 0.15)
    return Feet(np.full((1, 4), stand), np.zeros((1, 4, 3)), since)


@pytest.mark.parametrize(
    ("stands", "times", "kind", "landing", "liftoff", "touchdown"),
    [
        # as planned
        (True, (-0.4, 0.1, 0.4, 1.0), Disagreement.NONE, NEVER, 0.1, 0.4),
        (False, (-0.9, -0.15, 0.1, 1.0), Disagreement.NONE, NEVER, NEVER, 0.1),
        (True, (-1.2, -0.5, -0.2, 1.0), Disagreement.NONE, NEVER, NEVER, NEVER),
        # stands, though the plan has it swing
        (True, (-0.9, -0.02, 0.2, 1.0), Disagreement.LIFTS_LATE, NEVER, 0.0, 0.2),
        (True, (-0.9, -0.25, 0.02, 1.0), Disagreement.LANDED_EARLY, NEVER, NEVER, NEVER),
        # swings, though the plan has it stand
        (False, (-0.9, -0.3, -0.02, 1.0), Disagreement.LANDS_LATE, NEVER, NEVER, 0.05),
        (False, (-0.03, 0.5, 0.8, 1.5), Disagreement.LANDS_LATE, 0.05, 0.5, 0.8),
        (False, (-0.6, 0.03, 0.25, 1.0), Disagreement.LIFTED_EARLY, NEVER, NEVER, 0.25),
        # too little time to land before it lifts off again
        (False, (-0.02, 0.04, 0.25, 1.0), Disagreement.LIFTED_EARLY, NEVER, NEVER, 0.25),
        # a first stance still to come is landed on when it comes
        (False, (0.08, 0.6, 0.8, 1.5), Disagreement.LANDS_LATE, 0.08, 0.6, 0.8),
    ],
)
def test_the_nearest_change_settles_a_disagreement(
    stands, times, kind, landing, liftoff, touchdown
):
    found = schedule(plan_with(times), feet_that(stands), landing_time=0.05, window=0.3)
    assert (found.disagreement == kind).all()
    assert (found.landing == landing).all()
    assert (found.liftoff == liftoff).all()
    assert (found.touchdown == touchdown).all()


@pytest.mark.parametrize("rounding", [-1e-12, 0.0, 1e-12])
@pytest.mark.parametrize("stands", [True, False])
def test_a_change_at_the_epoch_to_rounding_is_no_disagreement(rounding, stands):
    lifting = plan_with((-0.6, rounding, 0.25, 1.0))
    assert not schedule(lifting, feet_that(stands), 0.05, 0.3).disagreement.any()
    if stands:
        landing = plan_with((-0.6, -0.25, rounding, 1.0))
        assert not schedule(landing, feet_that(True), 0.05, 0.3).disagreement.any()


def test_a_change_at_the_windows_end_belongs_to_the_window():
    found = schedule(plan_with((-0.6, 0.3 + 1e-12, 0.6, 1.0)), feet_that(True), 0.05, 0.3)
    assert (found.liftoff == 0.3).all()
