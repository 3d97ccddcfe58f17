"""Each kind of violation, planted into a sound walk, is found with its size."""

from dataclasses import replace

import numpy as np
import pytest

from lmtr.errors import DataError
from lmtr.geometry.se2 import SE2
from lmtr.quality.kinematics import stance_slip
from lmtr.quality.measure import Violations, measure
from lmtr.robot.model import ANYMAL
from lmtr.trajectory.sample import sample_feet
from lmtr.trajectory.trajectory import Trajectory

NO_LINES = np.zeros((0, 3))


def amble(rng_seed=None):
    """A level walk on the spot, feet under their hips, each foot carrying 0.3 weights at most.

    At the start and the end all four feet stand and carry as much.
    """
    stances, duration = 4, 6.0
    times = np.zeros((4, 2 * stances))
    for foot in range(4):
        liftoff = 0.3 + 0.4 * foot + 1.7 * np.arange(stances - 1)
        times[foot, 1:-1] = np.stack([liftoff, liftoff + 0.3], axis=-1).reshape(-1)
    times[:, -1] = duration
    feet = np.repeat((ANYMAL.nominal_feet_B * [1.0, 1.0, 0.0])[:, None], stances, axis=1)
    middle = np.zeros((4, stances - 1, 5))
    middle[..., :3] = feet[:, :-1] + np.array([0.0, 0.0, 0.08])
    nodes = np.zeros((61, 2, 6))
    nodes[:, 0, 2] = ANYMAL.nominal_height
    forces = np.zeros((4, stances, 3, 2, 3))
    forces[:, :, 1, 0, 2] = 0.3 * ANYMAL.weight
    forces[:, 0, 0, 0, 2] = forces[:, -1, -1, 0, 2] = 0.3 * ANYMAL.weight
    return Trajectory(np.array(0.0), nodes, times, feet, middle, forces)


def changed(trajectory, name, index, value):
    array = getattr(trajectory, name).copy()
    array[index] = value
    return replace(trajectory, **{name: array})


def found(trajectory, lines=NO_LINES):
    return measure(trajectory, ANYMAL, lines)


def test_nothing_is_found_in_a_sound_walk():
    violations = found(amble())
    for name in (
        "stance_overshoot",
        "swing_overshoot",
        "friction_excess",
        "pull",
        "contact_change_force",
        "stance_slip",
        "stance_height",
        "swing_depth",
        "flight_time",
        "height_deviation",
        "tilt",
    ):
        assert getattr(violations, name) == pytest.approx(0.0, abs=1e-12), name
    assert violations.fewest_feet_down == 3
    assert violations.sparse_support_time == 0.0
    assert violations.swing_shortest == pytest.approx(0.3)
    assert violations.stance_shortest == pytest.approx(0.3)
    assert violations.force_peak == pytest.approx(0.3)
    assert violations.closest_footholds == ()


@pytest.mark.parametrize("yaw", [0.0, 1.2])
def test_a_foothold_out_of_the_box_is_found_wherever_the_robot_faces(yaw):
    far = changed(amble(), "footholds", (0, 1, 0), ANYMAL.nominal_forward + 0.16 + 0.025)
    violations = found(far.moved(SE2.of([2.0, 1.0, yaw])))
    assert violations.stance_overshoot == pytest.approx(0.025, abs=1e-9)


def test_the_box_turns_with_roll_and_pitch():
    pitched = changed(amble(), "base_nodes", (slice(None), 0, 4), 0.3)
    # A fore foot at (0.34, −0.42) before the hip plane, turned by the pitch: it rises by 0.34·sin.
    c, s = np.cos(0.3), np.sin(0.3)
    below = -0.42 * c + 0.34 * s + 0.42
    behind = abs(-0.34 * c + 0.42 * s + 0.34)
    fore = abs(0.34 * c + 0.42 * s - 0.34)
    hind_drop = abs(-0.42 * c - 0.34 * s + 0.42)
    expected = max(below - 0.10, behind - 0.16, fore - 0.16, hind_drop - 0.10)
    assert found(pitched).stance_overshoot == pytest.approx(expected, abs=1e-9)


def test_lifting_a_swing_foot_high_is_no_overshoot_but_swinging_it_wide_is():
    high = changed(amble(), "swing_nodes", (1, 0, 2), 0.25)
    assert found(high).swing_overshoot == 0.0
    wide = changed(amble(), "swing_nodes", (1, 0, 1), -ANYMAL.nominal_lateral - 0.12 - 0.03)
    violations = found(wide)
    assert violations.swing_overshoot == pytest.approx(0.03, abs=1e-4)
    assert violations.stance_overshoot == 0.0


def test_friction_is_judged_between_the_nodes_too():
    pushing = changed(amble(), "force_nodes", (2, 1, 1, 0, 0), 0.25 * ANYMAL.weight)
    assert found(pushing).friction_excess == pytest.approx(0.25 - 0.7 * 0.3, abs=1e-9)
    # A slope at the node lets the force overshoot after it, against an unchanged normal force.
    swinging = changed(amble(), "force_nodes", (2, 1, 1, 1, 0), 1.5 * ANYMAL.weight)
    assert found(swinging).friction_excess > 0.02


def test_pulling_at_the_ground_is_found():
    pulling = changed(amble(), "force_nodes", (3, 2, 1, 0, 2), -0.05 * ANYMAL.weight)
    violations = found(pulling)
    assert violations.pull == pytest.approx(0.05, abs=1e-9)


def test_a_force_at_liftoff_is_found():
    stamping = changed(amble(), "force_nodes", (0, 2, -1, 0, 2), 0.2 * ANYMAL.weight)
    assert found(stamping).contact_change_force == pytest.approx(0.2)
    # At the very start and end there is no swing beside the stance: feet may carry load.
    resting = changed(amble(), "force_nodes", (0, 0, 0, 0, 2), 0.2 * ANYMAL.weight)
    assert found(resting).contact_change_force == 0.0


def test_a_slipping_foot_is_found():
    feet = sample_feet(amble(), np.arange(0.0, 6.0, 0.01))
    assert stance_slip(feet) == 0.0
    slipped = feet.position.copy()
    late = (feet.stance[:, 1] == 2) & feet.contact[:, 1]
    slipped[np.flatnonzero(late)[10:], 1, :2] += [0.03, -0.04]
    assert stance_slip(replace(feet, position=slipped)) == pytest.approx(0.05)


def test_feet_off_the_ground_and_below_it_are_found():
    floating = changed(amble(), "footholds", (1, 2, 2), 0.015)
    assert found(floating).stance_height == pytest.approx(0.015)
    digging = changed(amble(), "swing_nodes", (1, 1, 2), -0.04)
    assert found(digging).swing_depth == pytest.approx(0.04, abs=1e-6)


def test_a_flying_robot_is_found():
    jump = amble()
    together = replace(jump, contact_times=np.tile(jump.contact_times[:1], (4, 1)))
    violations = found(together)
    assert violations.fewest_feet_down == 0
    assert violations.sparse_support_time == pytest.approx(3 * 0.3, abs=0.02)
    # Four feet bear 1.2·(3u² − 2u³) weights as they take up or give off their load, in the local
    # time u of half a stance: less than a tenth of the weight for a part of it.
    light = next(u for u in np.linspace(0.0, 1.0, 10001) if 1.2 * (3 * u**2 - 2 * u**3) >= 0.1)
    halves = 0.15 + 4 * 0.7 + 1.0
    assert violations.flight_time == pytest.approx(3 * 0.3 + halves * light, abs=0.05)
    assert violations.support_least == 0.0


def test_a_hasty_phase_is_found():
    hasty = changed(amble(), "contact_times", (2, 2), amble().contact_times[2, 1] + 0.04)
    assert found(hasty).swing_shortest == pytest.approx(0.04)


def test_posture_is_measured_between_the_nodes():
    crouched = changed(amble(), "base_nodes", (30, 0, 2), ANYMAL.nominal_height - 0.2)
    assert found(crouched).height_deviation == pytest.approx(0.2)
    rolled = changed(amble(), "base_nodes", (30, 1, 3), 4.0)
    # A Hermite node with slope v alone reaches 4/27·v·h on either side.
    assert found(rolled).tilt == pytest.approx(4.0 / 27.0 * 4.0 * 0.1, rel=0.02)


def test_lines_are_kept_clear_of_by_chosen_footholds_only():
    lines = np.array([[0.34 + 0.07, 0.0, np.pi / 2.0], [0.0, 0.19 + 0.3, 0.0]])
    assert found(amble(), lines).closest_footholds == pytest.approx((0.07, 0.3))
    started_on_line = changed(amble(), "footholds", (0, 0, 0), 0.34 + 0.07)
    assert found(started_on_line, lines).closest_footholds[0] == pytest.approx(0.07)


def test_figures_carry_their_names():
    figures = found(amble(), np.array([[1.0, 0.0, 1.5], [2.0, 0.0, 1.5]])).as_dict()
    assert figures["closest_foothold_2"] > figures["closest_foothold_1"] > 0.0
    assert all(isinstance(value, float) for value in figures.values())
    assert "linear_residual_peak" in figures


@pytest.mark.parametrize("lines", [0, 1, 3])
def test_figures_by_name_are_the_violations_again(lines):
    violations = found(amble(), np.array([[1.0 + k, 0.0, 1.5] for k in range(lines)] or NO_LINES))
    again = Violations.from_dict(violations.as_dict())
    assert again == violations
    assert isinstance(again.fewest_feet_down, int)
    assert violations.closest_foothold == min(violations.closest_footholds, default=np.inf)


def test_figures_of_an_earlier_kind_are_refused_by_name():
    figures = found(amble()).as_dict()
    del figures["landing_rate"]
    with pytest.raises(DataError, match="landing_rate are missing"):
        Violations.from_dict(figures)


def test_batches_and_broken_numbers_are_refused():
    with pytest.raises(DataError, match="one solution at a time"):
        found(Trajectory.stack([amble(), amble()]))
    with pytest.raises(DataError, match="NaN"):
        found(changed(amble(), "footholds", (0, 0, 0), np.nan))
