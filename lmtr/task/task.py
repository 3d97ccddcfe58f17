"""A locomotion task for the expert: static start, goal pose, line obstacles (Sec. 4.2)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lmtr.arrays import Array
from lmtr.errors import TaskError
from lmtr.geometry.se2 import SE2
from lmtr.robot.model import FEET, N_FEET, RobotModel

MAX_OBSTACLES = 4
"""Obstacle lines that a task may have; a fifth would hardly leave room for a step."""

_ROUNDING = 1e-9
"""What rounding may add to the offset of a foot (m)."""


@dataclass(frozen=True)
class Task:
    """The expert's problem x̄ = (χ̄, γ̄, η̄) in the world frame; start and goal are static stances.

    Attributes:
        start_pose_W: Base x, y (m) and yaw (rad) at the start, (3,). χ̄
        start_feet_W: Foot x, y at the start, (4, 2) in m. χ̄
        goal_pose_W: Base x, y (m) and yaw (rad) at the end, (3,). γ̄
        obstacles_W: Lines (x, y, α) in m and rad, (n, 3), in the order they are met. η̄
    """

    start_pose_W: Array
    start_feet_W: Array
    goal_pose_W: Array
    obstacles_W: Array

    def __post_init__(self) -> None:
        shapes = {"start_pose_W": (3,), "start_feet_W": (N_FEET, 2), "goal_pose_W": (3,)}
        for name, shape in shapes.items():
            require_array("task", name, getattr(self, name), shape)
        require_array("task", "obstacles_W", self.obstacles_W, (len(self.obstacles_W), 3))

    def start_feet_B(self) -> Array:
        """Start feet relative to the start pose, (4, 2) in m."""
        return SE2.of(self.start_pose_W).over(1).invert().apply(self.start_feet_W)

    def require_possible(
        self, robot: RobotModel, duration: float, n_swings: int, margin: float
    ) -> None:
        """Refuse a task that no plan can solve.

        Args:
            robot: The robot that should solve it.
            duration: Time available, T̄ (s).
            n_swings: Swings per leg, N̄_p.
            margin: How far inside its range of motion the plan keeps a foot (m).

        Raises:
            TaskError: A start foot lies where no plan may keep it, or the goal is further away
                than the legs can reach with ``n_swings`` swings.
        """
        offsets = self.start_feet_B() - robot.nominal_feet_B[:, :2]
        for foot, offset in zip(FEET, offsets, strict=True):
            excess = foot_excess(offset, robot, margin)
            if excess > 0.0:
                raise TaskError(
                    f"task: start foot {foot} must stay within the range of motion "
                    f"±{robot.range_of_motion[:2]} m of robot {robot.name!r} less a margin of "
                    f"{margin} m, got {excess:.3f} m beyond; move it closer to neutral"
                )
        distance = float(np.linalg.norm(self.goal_pose_W[:2] - self.start_pose_W[:2]))
        limit = reach(robot, n_swings)
        if distance > limit:
            raise TaskError(
                f"task: the goal is {distance:.2f} m away, but robot {robot.name!r} reaches at "
                f"most {limit:.2f} m with {n_swings} swings per leg in {duration} s; "
                "bring the goal closer"
            )


def foot_excess(offset_B: ArrayLike, robot: RobotModel, margin: float) -> float:
    """How far (m) a foot lies beyond where plans keep it; 0 within, up to rounding.

    Args:
        offset_B: Its offset (2,) from neutral, forward and lateral (m).
        robot: The robot.
        margin: How far inside its range of motion plans keep a foot (m).
    """
    room = np.array(robot.range_of_motion[:2]) - margin
    excess = float((np.abs(offset_B) - room).max())
    return excess if excess > _ROUNDING else 0.0


def reach(robot: RobotModel, n_swings: int) -> float:
    """Furthest goal (m) that ``n_swings`` swings per leg can lead to.

    A stance lets the base sweep the range of motion once, and even a trot, in which a foot swings
    for as long as it stands, covers no more than that again in the swing.
    """
    return 2.0 * 2.0 * robot.range_of_motion[0] * (n_swings + 1)


def require_array(owner: str, name: str, array: Array, shape: tuple[int, ...]) -> None:
    """Refuse an array of another shape, or one that is not finite throughout.

    Raises:
        TaskError: It names the array and what was received.
    """
    if np.shape(array) != shape:
        raise TaskError(f"{owner}: {name} must have shape {shape}, got {np.shape(array)}")
    if not np.isfinite(array).all():
        raise TaskError(f"{owner}: {name} must be finite, got {np.asarray(array).tolist()}")
