"""The expert's first guess: a straight line to the goal, and the noise drawn for it on top."""

import numpy as np
import pytest

from lmtr.expert.initial_guess import initial_guess
from lmtr.expert.settings import Scope
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
    distribution = TaskDistribution(noise_position=0.3, noise_yaw=0.6, noise_timing=0.04)
    rng = np.random.default_rng(0)
    drawn = [sample_noise(distribution, SCOPE.n_swings, rng) for _ in range(2000)]
    expected = np.array([0.3, 0.3, 0.6]) / np.array([[1.0], [2.0], [3.0]])
    spread = np.std([noise.amplitudes for noise in drawn], axis=0)
    np.testing.assert_allclose(spread, expected, rtol=0.1)
    assert np.std([noise.timing for noise in drawn]) == pytest.approx(0.04, rel=0.02)
