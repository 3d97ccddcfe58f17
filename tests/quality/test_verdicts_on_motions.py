"""Each reason is given to a motion that shows the fault, and to no other.

A stand, which is balanced and accepted, and the walk of an initial guess, which is not balanced
yet, are spoilt in one way at a time.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lmtr.expert.initial_guess import initial_guess
from lmtr.expert.settings import Scope
from lmtr.quality.filter import QualityThresholds, judge
from lmtr.quality.jumping import ENERGY_WINDOW
from lmtr.quality.measure import measure
from lmtr.quality.rules import describe
from lmtr.robot.model import ANYMAL, GRAVITY
from lmtr.task.sampling import Noise
from lmtr.task.task import Task
from lmtr.trajectory.nodes import HEIGHT, RATE, VALUE
from lmtr.trajectory.trajectory import BASE_STEP, Trajectory

NO_LINES = np.zeros((0, 3))
LINE_UNDER_FORE_FEET = np.array([[0.34 + 0.03, 0.0, np.pi / 2.0]])
LIMITS = QualityThresholds()
WEIGHT = ANYMAL.weight
UNBALANCED = {"linear_residual", "angular_residual", "drift"}


def stand(duration=3.0):
    """Four feet in place for all time, a quarter of the weight on each."""
    n_nodes = round(duration / BASE_STEP) + 1
    base = np.zeros((n_nodes, 2, 6))
    base[:, VALUE, HEIGHT] = ANYMAL.nominal_height
    times = np.tile([0.0, duration], (4, 1))
    feet = (ANYMAL.nominal_feet_B * [1.0, 1.0, 0.0])[:, None]
    forces = np.zeros((4, 1, 3, 2, 3))
    forces[..., VALUE, 2] = 0.25 * WEIGHT
    return Trajectory(np.array(0.0), base, times, feet, np.zeros((4, 0, 5)), forces)


def walk():
    """The nominal walk half a metre ahead, foot after foot, with some rest at both ends."""
    task = Task(np.zeros(3), ANYMAL.nominal_feet_B[:, :2], np.array([0.5, 0.0, 0.0]), NO_LINES)
    scope = Scope(first_liftoff=0.6)
    quiet = Noise(np.zeros((3, 3)), np.zeros((4, 2 * scope.n_swings)))
    return initial_guess(task, quiet, ANYMAL, scope).trajectory


def changed(trajectory, name, index, change):
    array = getattr(trajectory, name).copy()
    array[index] = change(array[index]) if callable(change) else change
    return replace(trajectory, **{name: array})


def found(trajectory, lines=NO_LINES):
    return measure(trajectory, ANYMAL, lines)


def reasons(trajectory, lines=NO_LINES, **limits):
    thresholds = LIMITS.model_copy(update=limits)
    return set(judge("converged", 1.0, None, found(trajectory, lines), thresholds).reasons)


def hop(height):
    """A stand from whose middle the base flies up and falls back as a stone does."""
    speed = np.sqrt(2.0 * GRAVITY * height)
    time = BASE_STEP * np.arange(31) - 1.5
    aloft = np.abs(time) <= speed / GRAVITY
    base = stand().base_nodes.copy()
    base[aloft, VALUE, HEIGHT] += height - 0.5 * GRAVITY * time[aloft] ** 2
    base[aloft, RATE, HEIGHT] = -GRAVITY * time[aloft]
    return replace(stand(), base_nodes=base)


def all_aloft():
    """The walk, but in the second round of swings all feet lift off and touch down together."""
    times = walk().contact_times
    return changed(walk(), "contact_times", (slice(None), [3, 4]), times[1, [3, 4]])


STANDS = {
    "linear_residual": ("force_nodes", (slice(None), 0, 1, VALUE, 2), 0.3 * WEIGHT),
    "angular_residual": ("force_nodes", (slice(0, 2), 0, 1, VALUE, 2), 0.3 * WEIGHT),
    "drift": ("force_nodes", (slice(None), 0, slice(None), VALUE, 0), 0.02 * WEIGHT),
    "stance_range_of_motion": ("footholds", (0, 0, 0), lambda x: x + 0.20),
    "friction": ("force_nodes", (0, 0, 1, VALUE, 1), 0.3 * WEIGHT),
    "pull": ("force_nodes", (3, 0, 1, VALUE, 2), -0.05 * WEIGHT),
    "force_peak": ("force_nodes", (2, 0, 1, VALUE, 2), 1.5 * WEIGHT),
    "off_ground": ("footholds", (1, 0, 2), 0.02),
    "flight": ("force_nodes", (slice(None), 0, 1, VALUE, 2), 0.01 * WEIGHT),
    "energetic_jumping": ("base_nodes", (15, RATE, HEIGHT), 1.0),
    "height": ("base_nodes", (slice(None), VALUE, HEIGHT), lambda z: z - 0.09),
    "tilt": ("base_nodes", (slice(None), VALUE, 4), 0.25),
}
WALKS = {
    "swing_range_of_motion": ("swing_nodes", (0, 2, 1), lambda y: y + 0.2),
    "contact_change_force": ("force_nodes", (1, 2, -1, VALUE, 2), 0.1 * WEIGHT),
    "below_ground": ("swing_nodes", (2, 1, 2), -0.05),
    "hard_landing": ("force_nodes", (3, 1, 0, RATE, 2), 10.0 * WEIGHT),
    "phase_too_short": ("contact_times", (2, 4), lambda t: t - 0.2),
}


def test_standing_still_is_accepted():
    assert reasons(stand()) == set()


def test_the_walk_of_a_guess_lacks_nothing_but_balance():
    assert reasons(walk()) <= UNBALANCED


@pytest.mark.parametrize("reason", STANDS)
def test_a_stand_spoilt_is_refused_for_that(reason):
    given_reasons = reasons(changed(stand(), *STANDS[reason]))
    assert reason in given_reasons
    # Forces and motions that are changed by themselves unbalance the robot as well.
    assert given_reasons <= UNBALANCED | {reason}
    assert describe(reason).endswith(".")


@pytest.mark.parametrize("reason", WALKS)
def test_a_walk_spoilt_is_refused_for_that(reason):
    assert reasons(changed(walk(), *WALKS[reason])) - UNBALANCED == {reason}


def test_a_foothold_on_a_line_is_refused_if_it_was_chosen():
    assert "obstacle" not in reasons(stand(), LINE_UNDER_FORE_FEET)
    chosen = walk().footholds[0, 3]
    line = np.array([[chosen[0] + 0.03, 0.0, np.pi / 2.0]])
    assert "obstacle" in reasons(walk(), line)
    assert found(walk(), line).closest_foothold <= 0.03 + 1e-9


def test_all_feet_aloft_is_flight_for_as_long_as_it_lasts():
    violations = found(all_aloft())
    swing = Scope().nominal_swing
    assert violations.fewest_feet_down == 0
    assert violations.support_least == 0.0
    assert swing - 0.01 < violations.flight_time < swing + 0.2  # feet unload before, load after
    assert "flight" in reasons(all_aloft())


def test_feet_that_stand_and_bear_nothing_are_flight_too():
    fall = changed(stand(), "force_nodes", ..., 0.0)
    violations = found(fall)
    assert violations.fewest_feet_down == 4
    assert violations.flight_time == pytest.approx(3.0, abs=0.01)
    light = changed(stand(), "force_nodes", (..., VALUE, 2), 0.05 * WEIGHT)
    assert found(light).flight_time == 0.0
    assert found(light).support_least == pytest.approx(0.2)


@given(st.floats(0.02, 0.3))
@settings(max_examples=20, deadline=None)
def test_a_jump_swings_the_energy_by_its_height_and_is_named(height):
    violations = found(hop(height))
    # Nodes lie 0.1 s apart: the spline leaves the ground up to one interval early.
    assert violations.vertical_energy_swing >= 0.9 * height
    if height > LIMITS.vertical_energy_swing / 0.9:
        assert "energetic_jumping" in reasons(hop(height))


def test_rising_as_high_slowly_is_no_jump():
    base = stand().base_nodes.copy()
    time = BASE_STEP * np.arange(31)
    base[:, VALUE, HEIGHT] += 0.03 * (1.0 - np.cos(2.0 * np.pi * time / 3.0))
    base[:, RATE, HEIGHT] = 0.03 * 2.0 * np.pi / 3.0 * np.sin(2.0 * np.pi * time / 3.0)
    slow = replace(stand(), base_nodes=base)
    violations = found(slow)
    assert violations.vertical_speed == pytest.approx(0.03 * 2.0 * np.pi / 3.0, rel=0.01)
    # Half way up, the base rises by the sine of the window about it, and its speed hardly changes.
    rise = 2.0 * 0.03 * np.sin(np.pi * ENERGY_WINDOW / 3.0)
    assert violations.vertical_energy_swing == pytest.approx(rise, rel=0.05)
    assert "energetic_jumping" not in reasons(slow)


def test_landings_are_measured_after_touchdown_only():
    """A force that rises from rest as 3u² − 2u³ does is known at every time of the landing."""
    trajectory = walk()
    landed = np.diff(trajectory.contact_times, axis=-1)[:, 2::2]

    def force(peak, piece):
        u = 0.1 / piece
        return peak * (3.0 * u**2 - 2.0 * u**3)

    piece = landed.min() / 2.0
    violations = found(trajectory)
    assert violations.landing_force == pytest.approx(force(0.3, piece), rel=1e-6)
    steepest = 0.3 / piece * 6.0 * (0.1 / piece) * (1.0 - 0.1 / piece)
    assert violations.landing_rate == pytest.approx(steepest, rel=0.05)
    assert violations.landing_speed == 0.0
    heavy = changed(trajectory, "force_nodes", (0, 2, 1, VALUE, 2), 0.9 * WEIGHT)
    assert found(heavy).landing_force == pytest.approx(force(0.9, landed[0, 1] / 2.0), rel=1e-6)
    leaving = changed(trajectory, "force_nodes", (0, 2, 2, RATE, 2), -10.0 * WEIGHT)
    assert found(leaving).landing_rate == pytest.approx(violations.landing_rate, rel=1e-6)


def test_sinking_counts_as_a_hard_landing_at_a_touchdown_only():
    trajectory = walk()
    before = int(trajectory.touchdown_times[1, 2] / BASE_STEP)
    base = trajectory.base_nodes.copy()
    base[[before, before + 1], RATE, HEIGHT] = -0.4
    base[before + 1 :, VALUE, HEIGHT] -= 0.4 * BASE_STEP
    sinking = replace(trajectory, base_nodes=base)
    violations = found(sinking)
    assert violations.landing_speed == pytest.approx(0.4)
    assert "hard_landing" in reasons(sinking, vertical_speed=9.0, vertical_energy_swing=9.0)
    assert found(changed(stand(), "base_nodes", (9, RATE, HEIGHT), -0.4)).landing_speed == 0.0


def test_a_lifted_foot_may_come_near_the_base_but_may_not_be_stretched():
    box = ANYMAL.range_of_motion[2]
    high = changed(walk(), "swing_nodes", (1, 2, 2), 0.08 + box)
    assert found(high).swing_overshoot == found(walk()).swing_overshoot
    # With the base raised beyond the box, a foot that swings high enough is within reach again.
    raised = changed(walk(), "base_nodes", (..., VALUE, HEIGHT), lambda z: z + box + 0.02)
    stretched = found(raised).swing_overshoot
    assert stretched == pytest.approx(0.02, abs=2e-3)  # as it leaves the ground
    crouched = changed(walk(), "base_nodes", (..., VALUE, HEIGHT), lambda z: z - box - 0.02)
    assert found(crouched).swing_overshoot == pytest.approx(0.02, abs=1e-9)
