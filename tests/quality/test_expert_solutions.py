"""Solutions of the expert pass the independent check, and their segments are their own motion."""

import numpy as np
import pytest

from lmtr.expert.settings import ExpertSettings
from lmtr.expert.solve import Expert
from lmtr.geometry.se2 import SE2
from lmtr.quality.filter import QualityThresholds, expected_cost, judge
from lmtr.quality.measure import measure
from lmtr.quality.status import Status
from lmtr.robot.model import ANYMAL
from lmtr.segmentation.window import cut, valid_epochs
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import TaskDistribution, sample_noise, sample_task
from lmtr.trajectory.sample import sample_base
from lmtr.vectors.segment_vector import decode_segment, encode_segment

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def solved():
    expert, distribution = Expert(ANYMAL, ExpertSettings(), None), TaskDistribution()
    pairs = []
    for index in range(4):
        rng = stream(12345, Purpose.TASK, index)
        task = sample_task(distribution, ANYMAL, rng)
        noise = sample_noise(distribution, expert.settings.scope.n_swings, rng)
        pairs.append((task, expert.solve(task, noise)))
    return pairs


LAWS = {
    "friction",
    "pull",
    "contact_change_force",
    "slip",
    "off_ground",
    "below_ground",
    "flight",
    "phase_too_short",
}


def test_expert_solutions_break_no_law_and_most_are_accepted(solved):
    limits, accepted = QualityThresholds(), 0
    for task, solution in solved:
        violations = measure(solution.trajectory, ANYMAL, task.obstacles_W)
        expected = expected_cost(task, ANYMAL, ExpertSettings().cost_key(ANYMAL), limits)
        assert expected is not None
        verdict = judge(
            solution.status, solution.cost, expected, violations, limits, solution.saturated
        )
        assert solution.status == Status.CONVERGED
        assert not LAWS & set(verdict.reasons)
        accepted += verdict.accepted
        assert violations.drift < 0.015
        assert violations.linear_residual_rms < 0.25
    assert accepted > len(solved) / 2


def test_expert_guesses_are_not(solved):
    for task, solution in solved:
        violations = measure(solution.guess, ANYMAL, task.obstacles_W)
        verdict = judge(Status.CONVERGED, solution.cost, None, violations, QualityThresholds())
        assert "angular_residual" in verdict.reasons
        assert "drift" in verdict.reasons


def test_segments_hold_the_experts_base_motion_closely(solved):
    times = np.linspace(0.0, 0.8, 41)
    for index, (_, solution) in enumerate(solved):
        trajectory = solution.trajectory
        epochs = np.random.default_rng(index).uniform(0.0, 6.7, 40)
        epochs = epochs[valid_epochs(trajectory, epochs)]
        start = sample_base(trajectory, epochs)
        frames = SE2(start.position[:, 0], start.position[:, 1], start.rpy[:, 2])
        windows = decode_segment(encode_segment(cut(trajectory, epochs))).moved(frames, epochs)
        for k, epoch in enumerate(epochs):
            mine, theirs = (sample_base(t, epoch + times) for t in (windows[k], trajectory))
            assert np.abs(mine.position - theirs.position).max() < 1e-4
            assert np.abs(mine.rpy - theirs.rpy).max() < 3e-4
            assert np.abs(mine.velocity - theirs.velocity).max() < 1e-2
