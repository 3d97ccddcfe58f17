"""What a replanner is shown in a rollout: all of x = (χ, η, γ), as the expert's data have it."""

from dataclasses import replace

import numpy as np
import pytest

from lmtr.expert.initial_guess import initial_guess
from lmtr.expert.settings import Scope
from lmtr.robot.model import ANYMAL
from lmtr.rollout.courses import Course, random_courses
from lmtr.rollout.settings import RolloutSettings
from lmtr.rollout.testbed import run_rollouts
from lmtr.segmentation.window import cut
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import TaskDistribution, sample_noise
from lmtr.task.task import Task
from lmtr.trajectory.nodes import RATE, VALUE
from lmtr.trajectory.trajectory import BASE_STEP
from lmtr.vectors.layout import TASK_LAYOUT
from lmtr.vectors.segment_vector import encode_segment
from lmtr.vectors.state import state_at
from lmtr.vectors.task_vector import encode_task

FIRST_EPOCH = 0.5
GOAL_AHEAD = 0.8  # what the mission asks for (m)

SWAY = np.array([0.0, 0.02, 0.015, 0.06, 0.05, 0.12])
"""Amplitudes over x, y, z (m) and roll, pitch, yaw (rad)."""

RATES = np.array([1.0, 2.1, 3.3, 2.7, 3.9, 1.7])
"""Angular frequencies of the same (rad/s), no two alike."""


def swaying_walk(index):
    """A walk of 9 s whose base sways smoothly in every direction but the forward one."""
    scope = Scope(duration=9.0, n_swings=6)
    task = Task(
        np.zeros(3), ANYMAL.nominal_feet_B[:, :2], np.array([3.0, 0.4, 0.3]), np.zeros((0, 3))
    )
    noise = sample_noise(TaskDistribution(noise_position=0.1), 6, stream(5, Purpose.TASK, index))
    walk = initial_guess(task, noise, ANYMAL, scope).trajectory
    phase = RATES * BASE_STEP * np.arange(len(walk.base_nodes))[:, None] + 0.7 * index
    nodes = np.array(walk.base_nodes)
    nodes[:, VALUE] += SWAY * np.sin(phase)
    nodes[:, RATE] += SWAY * RATES * np.cos(phase)
    return replace(walk, base_nodes=nodes)


class Listening:
    """Replays walks window by window, and keeps the tasks that it was given."""

    name, nbytes = "listening", 0

    def __init__(self, walks, settings):
        self.walks, self.settings = walks, settings
        self.tasks = []

    def windows(self, cycle):
        epoch = np.array([FIRST_EPOCH + self.settings.period * cycle])
        return np.concatenate([encode_segment(cut(walk, epoch)) for walk in self.walks])

    def plan(self, x):
        self.tasks.append(np.array(x))
        return self.windows(len(self.tasks) - 1)

    def describe(self):
        return {}


@pytest.fixture(scope="module")
def rules():
    return RolloutSettings(duration=6.0)


def listened(walks, courses, rules):
    """The tasks (cycle, row, 35) that a replay of the walks over the courses brings."""
    listening = Listening(walks, rules)
    rollouts = run_rollouts(listening, courses, listening.windows(0), rules, ANYMAL)
    assert not any(rollout.diverged for rollout in rollouts)
    return np.array(listening.tasks)


def test_every_number_of_the_task_is_that_of_the_walk_among_the_lines_of_its_course(rules):
    walks, courses = [swaying_walk(index) for index in range(3)], random_courses(rules, 0, range(3))
    tasks = listened(walks, courses, rules)
    assert tasks.shape == (20, 3, 35)
    for row, (walk, course) in enumerate(zip(walks, courses, strict=True)):
        # The rollout's world has its origin under the walk's base at the first epoch.
        world = state_at(walk, FIRST_EPOCH).frame_W
        moved = walk.seen_from(world, FIRST_EPOCH)
        for cycle, x in enumerate(tasks[:, row]):
            state = state_at(moved, rules.period * cycle)
            goal = np.array([state.frame_W.x + GOAL_AHEAD, 0.0, 0.0])
            expected = encode_task(state, course.obstacles_W, goal)
            np.testing.assert_allclose(x, expected, rtol=0.0, atol=1e-9)
    seen = TASK_LAYOUT.unpack(tasks.reshape(-1, 35))
    # The case is hard: the robot tilts, turns, climbs and drifts, and meets lines.
    assert (np.abs(seen["roll_pitch"]).max(axis=0) > 0.03).all()
    assert (np.abs(seen["angular_velocity"]).max(axis=0) > 0.05).all()
    assert (np.abs(seen["linear_velocity"]).max(axis=0) > 0.03).all()
    assert np.abs(np.arctan2(*seen["goal_heading"].T[::-1])).max() > 0.1
    assert np.ptp(seen["next_lines"][:, 0, 0]) > 0.3
    assert seen["LF_time_since_liftoff"].max() > 0.0


def test_a_line_is_shown_until_it_is_half_a_metre_behind_the_base(rules):
    walk = swaying_walk(0)
    # At this cycle one course's line is just less than half a metre behind, the other's just more.
    cycle = 10
    origin = state_at(walk, FIRST_EPOCH).frame_W
    base = origin.invert() @ state_at(walk, FIRST_EPOCH + rules.period * cycle).frame_W
    courses = [Course(0, row, square_line(base, d)) for row, d in enumerate((-0.49, -0.51))]
    tasks = TASK_LAYOUT.unpack(listened([walk, walk], courses, rules)[cycle])
    first = tasks["next_lines"][:, 0]
    np.testing.assert_allclose(first[0], [-0.49, 0.0, np.pi / 2.0], atol=1e-9)
    assert first[1, 0] > 1.0


def square_line(base, ahead):
    """A line square to the base's x axis, so far ahead of the base (m); (1, 3)."""
    return np.array([[*base.apply(np.array([ahead, 0.0])), base.yaw + np.pi / 2.0]])
