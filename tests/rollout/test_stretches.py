"""Courses as tasks of the expert: every line in one stretch, and each stretch possible."""

import numpy as np
import pytest

from lmtr.expert.settings import ExpertSettings
from lmtr.robot.model import ANYMAL, HYQ
from lmtr.rollout.courses import Course, random_course
from lmtr.rollout.settings import RolloutSettings
from lmtr.rollout.stretches import stretches
from lmtr.task.sampling import TaskDistribution
from lmtr.task.task import MAX_OBSTACLES

TASKS = TaskDistribution()
SQUARE = np.pi / 2.0


def test_a_course_by_hand():
    """Goals 2.7 m ahead, hind feet at most 0.5 m behind: lines up to 2.2 m on are crossed."""
    x = [1.0, 1.6, 2.2, 2.8, 3.4]
    course = Course(0, 0, np.array([[each, 0.0, SQUARE] for each in x]))
    parts = stretches(course, 3.0, TASKS, ANYMAL)
    assert [part.judged_W[:, 0].tolist() for part in parts] == [[1.0, 1.6, 2.2], [2.8]]
    assert [part.task.start_pose_W[0] for part in parts] == pytest.approx([0.1, 1.9])
    assert [part.task.goal_pose_W[0] for part in parts] == pytest.approx([2.8, 4.6])
    # At the goal the expert must not tread on the line that the next stretch crosses.
    assert parts[0].task.obstacles_W[:, 0].tolist() == [1.0, 1.6, 2.2, 2.8]
    assert stretches(course, 0.5, TASKS, ANYMAL) == []


@pytest.mark.parametrize("robot", [ANYMAL, HYQ])
def test_every_line_is_judged_once_and_every_task_is_possible(robot):
    scope, margin = ExpertSettings().scope, ExpertSettings().range_of_motion_margin
    for index in range(30):
        course = random_course(RolloutSettings(), 3, index)
        parts = stretches(course, 10.8, TASKS, robot)
        judged = np.concatenate([part.judged_W for part in parts])
        expected = course.obstacles_W[course.obstacles_W[:, 0] <= 10.8]
        np.testing.assert_array_equal(judged, expected)
        for part in parts:
            assert 1 <= len(part.judged_W) <= len(part.task.obstacles_W) <= MAX_OBSTACLES
            part.task.require_possible(robot, scope.duration, scope.n_swings, margin)


def test_crowded_lines_are_at_most_as_many_as_a_task_has():
    lines = np.array([[1.0 + 0.2 * k, 0.0, SQUARE] for k in range(9)])
    parts = stretches(Course(0, 0, lines), 9.0, TASKS, ANYMAL)
    assert [len(part.judged_W) for part in parts] == [4, 4, 1]
