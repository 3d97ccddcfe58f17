"""The expert's first guess: a straight line to the goal, and the noise drawn for it on top."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lmtr.expert.initial_guess import contact_times, initial_guess
from lmtr.expert.settings import ExpertSettings, Scope
from lmtr.expert.timing import windows
from lmtr.robot.model import ANYMAL
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import Noise, TaskDistribution, sample_noise, sample_task
from lmtr.trajectory.sample import sample_base
from lmtr.trajectory.trajectory import BASE_STEP

SCOPE = Scope()
TIMES = np.linspace(0.3, SCOPE.duration - 0.3, 200)
PHASE = (TIMES - BASE_STEP) / (SCOPE.duration - 2.0 * BASE_STEP)
"""The line is run through between the first and the last knot but one."""

UNSHIFTED = np.zeros((4, 2 * SCOPE.n_swings))
TASK = sample_task(TaskDistribution(), ANYMAL, stream(0, Purpose.TASK, 0))
LINE = TASK.start_pose_W + PHASE[:, None] * (TASK.goal_pose_W - TASK.start_pose_W)


def guessed(noise):
    return initial_guess(TASK, noise, ANYMAL, SCOPE).trajectory


def departure(noise):
    """How far the guessed base is off the line in x, y (m) and yaw (rad), (M, 3)."""
    base = sample_base(guessed(noise), TIMES)
    np.testing.assert_allclose(base.rpy[:, :2], 0.0, atol=1e-12)
    return np.column_stack([base.position[:, :2], base.rpy[:, 2]]) - LINE


def sines(amplitudes, phase):
    return sum(
        amplitudes[f - 1] * np.sin(np.pi * f * np.asarray(phase)[..., None]) for f in (1, 2, 3)
    )


def test_without_noise_the_base_keeps_to_the_line():
    np.testing.assert_allclose(departure(Noise(np.zeros((3, 3)), UNSHIFTED)), 0.0, atol=1e-9)


@pytest.mark.parametrize("coordinate", range(3), ids=["x", "y", "yaw"])
@pytest.mark.parametrize("harmonic", [1, 2, 3])
def test_each_amplitude_is_a_sine_in_its_own_coordinate(harmonic, coordinate):
    amplitudes = np.zeros((3, 3))
    amplitudes[harmonic - 1, coordinate] = 0.2
    found = departure(Noise(amplitudes, UNSHIFTED))
    # The spline smooths its control points by h²/6 times their second derivative.
    np.testing.assert_allclose(found, sines(amplitudes, PHASE), atol=1e-3)


def test_the_guess_departs_from_the_line_by_the_drawn_sines():
    noise = sample_noise(TaskDistribution(), SCOPE.n_swings, stream(0, Purpose.TASK, 1))
    found = departure(noise)
    assert (np.abs(found).max(axis=0) > 0.02).all()
    np.testing.assert_allclose(found, sines(noise.amplitudes, PHASE), atol=2e-3)


def test_footholds_go_with_the_drawn_sines():
    noise = sample_noise(TaskDistribution(), SCOPE.n_swings, stream(0, Purpose.TASK, 1))
    trajectory = guessed(noise)
    times = trajectory.contact_times
    phase = (0.5 * (times[:, 0::2] + times[:, 1::2]) / SCOPE.duration)[:, 1:-1]
    change = TASK.goal_pose_W - TASK.start_pose_W
    x, y, yaw = np.moveaxis(
        TASK.start_pose_W + phase[..., None] * change + sines(noise.amplitudes, phase), -1, 0
    )
    ahead, beside = (ANYMAL.nominal_feet_B[:, axis, None] for axis in (0, 1))
    expected = np.stack(
        [
            x + np.cos(yaw) * ahead - np.sin(yaw) * beside,
            y + np.sin(yaw) * ahead + np.cos(yaw) * beside,
        ],
        axis=-1,
    )
    np.testing.assert_allclose(trajectory.footholds[:, 1:-1, :2], expected, atol=1e-9)


def test_amplitudes_are_drawn_as_the_distribution_says():
    distribution = TaskDistribution(
        noise_position=0.3, noise_yaw=0.6, noise_timing=0.04, noise_pace=0.0, noise_pairing=0.0
    )
    rng = np.random.default_rng(0)
    drawn = [sample_noise(distribution, SCOPE.n_swings, rng) for _ in range(2000)]
    expected = np.array([0.3, 0.3, 0.6]) / np.array([[1.0], [2.0], [3.0]])
    spread = np.std([noise.amplitudes for noise in drawn], axis=0)
    np.testing.assert_allclose(spread, expected, rtol=0.1)
    assert np.std([noise.timing for noise in drawn]) == pytest.approx(0.04, rel=0.02)


NOMINAL = contact_times(SCOPE, (0, 1, 2, 3))
STILL = np.zeros((3, 3))
QUIET = {"noise_timing": 0.0, "noise_pace": 0.0, "noise_pairing": 0.0, "noise_first_foot": 0.0}


def drawn_timing(**noise):
    """Offsets of contact changes, (2000, 4, 2·N̄_p), with one kind of noise alone."""
    rng = np.random.default_rng(1)
    distribution = TaskDistribution(**(QUIET | noise))
    return np.stack([sample_noise(distribution, SCOPE.n_swings, rng).timing for _ in range(2000)])


def test_without_noise_on_the_gait_every_contact_change_is_nominal():
    np.testing.assert_array_equal(drawn_timing(), 0.0)
    times = contact_times(SCOPE, (0, 1, 2, 3), Noise(STILL, UNSHIFTED))
    np.testing.assert_allclose(times, NOMINAL, atol=1e-12)


def test_noise_on_the_pace_delays_all_feet_alike_and_no_swing_grows():
    timing = drawn_timing(noise_pace=0.1)
    np.testing.assert_array_equal(timing[..., 0::2], timing[..., 1::2])
    np.testing.assert_array_equal(timing[:, 0, 0], 0.0)  # the first step is on time
    # Half-way the first and the third sine are at their tops, 1 and 1/3 high.
    assert timing[:, 0, 6].std() == pytest.approx(0.1 * np.hypot(1.0, 1.0 / 3.0), rel=0.05)
    neighbours = np.corrcoef(timing[:, 1, 6], timing[:, 2, 6])[0, 1]
    assert neighbours > 0.9


def test_pairing_moves_all_steps_of_every_other_foot_ahead_by_up_to_its_setting():
    timing = drawn_timing(noise_pairing=0.2)
    np.testing.assert_array_equal(timing[:, [0, 2]], 0.0)
    np.testing.assert_array_equal(np.ptp(timing[:, [1, 3]].reshape(2000, -1), axis=1), 0.0)
    assert timing[:, 1, 0].min() == pytest.approx(-0.2, abs=2e-3)
    assert timing[:, 1, 0].max() == pytest.approx(0.0, abs=2e-3)
    assert timing[:, 1, 0].mean() == pytest.approx(-0.1, rel=0.05)


@pytest.mark.parametrize("chance", [0.0, 0.3, 1.0])
def test_another_foot_begins_as_often_as_asked(chance):
    rng = np.random.default_rng(2)
    distribution = TaskDistribution(noise_first_foot=chance)
    first = [sample_noise(distribution, SCOPE.n_swings, rng).first for _ in range(2000)]
    assert np.mean(np.array(first) > 0) == pytest.approx(chance, abs=0.03)
    if chance > 0.0:
        assert set(first) - {0} == {1, 2, 3}


@pytest.mark.parametrize("first", range(4))
def test_the_foot_that_the_noise_names_lifts_off_first(first):
    usual = initial_guess(TASK, Noise(STILL, UNSHIFTED), ANYMAL, SCOPE).order
    guess = initial_guess(TASK, Noise(STILL, UNSHIFTED, first), ANYMAL, SCOPE)
    assert guess.order == usual[first:] + usual[:first]
    assert int(guess.trajectory.liftoff_times[:, 0].argmin()) == usual[first]


@given(arrays(float, (4, 2 * SCOPE.n_swings), elements=st.floats(-9.0, 9.0)))
def test_no_noise_reorders_a_foots_events_or_shrinks_a_phase_to_nothing(timing):
    times = contact_times(SCOPE, (2, 0, 3, 1), Noise(STILL, timing))
    durations = np.diff(times, axis=1)
    assert durations[:, 1::2].min() >= 0.8 * SCOPE.nominal_swing - 1e-9
    inner = durations[:, 2:-1:2]
    assert inner.min() >= 0.3 * (SCOPE.nominal_cycle - SCOPE.nominal_swing) - 1e-9
    assert durations[:, [0, -1]].min() >= 0.7 * SCOPE.first_liftoff - 1e-9
    assert times.min() >= 0.0
    assert times.max() <= SCOPE.duration


def test_default_noise_starts_well_inside_the_windows_and_limits():
    settings, rng = ExpertSettings(), np.random.default_rng(3)
    around, limits = windows(settings), settings.limits
    for _ in range(500):
        noise = sample_noise(TaskDistribution(), SCOPE.n_swings, rng)
        times = contact_times(SCOPE, (0, 1, 2, 3), noise)
        assert (np.abs(times - around.nominal) < 0.9 * limits.window).all()
        swings = np.diff(times, axis=1)[:, 1::2]
        assert limits.swing[0] < swings.min()
        assert swings.max() < limits.swing[1]
