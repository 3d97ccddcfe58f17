"""Courses cut into tasks for the expert, the offline line of reference of Sec. 5.

The expert plans from rest to rest over a few metres, so it walks a course a stretch at a time. Each
stretch starts in neutral stance, well before the first line that has not been crossed yet, and ends
where its tasks end; every line is crossed, and judged, in one stretch.
"""

from dataclasses import dataclass

import numpy as np

from lmtr.arrays import Array
from lmtr.robot.model import RobotModel
from lmtr.rollout.courses import Course
from lmtr.task.sampling import TaskDistribution
from lmtr.task.task import MAX_OBSTACLES, Task


@dataclass(frozen=True)
class Stretch:
    """A part of a course as the expert's task.

    Attributes:
        task: From neutral stance on the course's x axis to a goal ahead.
        judged_W: The lines that are crossed in this stretch, (n, 3) in m and rad.
    """

    task: Task
    judged_W: Array


def stretches(
    course: Course, length: float, distribution: TaskDistribution, robot: RobotModel
) -> list[Stretch]:
    """Cut the beginning of a course into stretches.

    Args:
        course: The course.
        length: Lines up to here are crossed (m).
        distribution: The expert's tasks; stretches take the middle of its ranges for the way to the
            first line and to the goal.
        robot: Its neutral stance, and how far hind feet may be behind.

    Returns:
        At least one stretch, if any line lies within the length.
    """
    lines_W = course.obstacles_W
    ahead = float(np.mean(distribution.first_obstacle))
    way = float(np.mean(distribution.goal_distance))
    within = lines_W[:, 0] <= length
    made: list[Stretch] = []
    first, last = 0, int(within.sum())
    while first < last:
        start = float(lines_W[first, 0]) - ahead
        crossed = lines_W[:, 0] + _half_width(lines_W, robot) < start + way - _behind(robot)
        # Whatever the settings, each stretch brings the robot over a line.
        after = min(max(int(crossed.sum()), first + 1), first + MAX_OBSTACLES, last)
        seen = np.flatnonzero(lines_W[:, 0] <= start + way)
        ends = min(max(int(seen[-1]) + 1, after), first + MAX_OBSTACLES)
        made.append(Stretch(_task(start, way, lines_W[first:ends], robot), lines_W[first:after]))
        first = after
    return made


def _task(start: float, way: float, lines_W: Array, robot: RobotModel) -> Task:
    begin = np.array([start, 0.0])
    return Task(
        start_pose_W=np.array([start, 0.0, 0.0]),
        start_feet_W=robot.nominal_feet_B[:, :2] + begin,
        goal_pose_W=np.array([start + way, 0.0, 0.0]),
        obstacles_W=lines_W,
    )


def _behind(robot: RobotModel) -> float:
    """How far behind the base a hind foot may stand (m)."""
    return robot.nominal_forward + robot.range_of_motion[0]


def _half_width(lines_W: Array, robot: RobotModel) -> Array:
    """How much further ahead a turned line runs under one of the tracks, (n,) in m."""
    return np.asarray(np.abs(robot.nominal_lateral / np.tan(lines_W[:, 2])))
