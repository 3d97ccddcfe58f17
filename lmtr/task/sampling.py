"""The distribution of expert tasks 𝒳 and the smooth noise ξ̄ on initial guesses (Sec. 3.1, 4.2).

Everything random of one solution comes from one stream of :mod:`lmtr.streams`, by the solution's
index, so a data set is the same whatever the number of workers or the order in which they finish.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from lmtr.arrays import Array
from lmtr.robot.model import N_FEET, RobotModel
from lmtr.settings import NonNegative, PositiveRange, Settings, ascending
from lmtr.task.task import MAX_OBSTACLES, Task, require_array

Lines = Annotated[int, Field(ge=0, le=MAX_OBSTACLES)]
"""How many obstacle lines."""


class TaskDistribution(Settings):
    """Ranges that tasks are drawn from, uniformly.

    Attributes:
        goal_distance: Goal ahead of the start, along its yaw (m).
        goal_lateral: Largest sideways offset of the goal (m).
        goal_yaw: Largest turn of the goal (rad).
        obstacle_count: Fewest and most obstacle lines; the paper has two.
        first_obstacle: Distance of the first line ahead of the start (m).
        obstacle_spacing: Distance from one line to the next (m).
        obstacle_turn: Largest turn of a line away from square to the path (rad).
        foot_scatter: Largest offset of start feet from neutral, forward and lateral (m).
        noise_position: Amplitude a of the noise on x and y (m).
        noise_yaw: Amplitude a of the noise on yaw (rad).
        noise_timing: Standard deviation of the noise on contact times (s).
    """

    goal_distance: PositiveRange = (2.3, 3.1)
    goal_lateral: NonNegative = 0.4
    goal_yaw: NonNegative = 0.4
    obstacle_count: Annotated[tuple[Lines, Lines], ascending()] = (2, 2)
    first_obstacle: PositiveRange = (0.7, 1.1)
    obstacle_spacing: PositiveRange = (0.5, 1.1)
    obstacle_turn: NonNegative = 0.5
    foot_scatter: tuple[NonNegative, NonNegative] = (0.06, 0.036)
    noise_position: NonNegative = 0.15
    noise_yaw: NonNegative = 0.2
    noise_timing: NonNegative = 0.05


@dataclass(frozen=True)
class Noise:
    """Smooth noise ξ̄ for one initial guess.

    Attributes:
        amplitudes: Factors a·N(0, 1)/f of sin(π·f·t/T̄) for f = 1, 2, 3 on the base's x, y (m)
            and yaw (rad), (3 harmonics, 3).
        timing: Offsets of the contact changes, slot by slot, in units of s, (4, 2·N̄_p).
    """

    amplitudes: Array
    timing: Array

    def __post_init__(self) -> None:
        require_array("noise", "amplitudes", self.amplitudes, (len(self.amplitudes), 3))
        require_array("noise", "timing", self.timing, (N_FEET, np.shape(self.timing)[-1]))

    def require_scope(self, n_swings: int) -> None:
        """Refuse to be used for another number N̄_p of swings than it was drawn for.

        Raises:
            TaskError: There is not one offset for each contact change.
        """
        require_array("noise", "timing", self.timing, (N_FEET, 2 * n_swings))

    def on_base(self, phase: Array) -> Array:
        """Offsets of x, y (m) and yaw (rad) at times t = phase·T̄, (..., 3); zero at both ends."""
        harmonics = np.arange(1, len(self.amplitudes) + 1)
        return np.asarray(np.sin(np.pi * phase[..., None] * harmonics) @ self.amplitudes)


def sample_task(
    distribution: TaskDistribution, robot: RobotModel, rng: np.random.Generator
) -> Task:
    """Draw a task whose start pose is the world's origin."""
    goal = np.array(
        [
            rng.uniform(*distribution.goal_distance),
            rng.uniform(-1.0, 1.0) * distribution.goal_lateral,
            rng.uniform(-1.0, 1.0) * distribution.goal_yaw,
        ]
    )
    scatter = rng.uniform(-1.0, 1.0, (N_FEET, 2)) * np.array(distribution.foot_scatter)
    count = int(rng.integers(distribution.obstacle_count[0], distribution.obstacle_count[1] + 1))
    gaps = [
        rng.uniform(*(distribution.obstacle_spacing if k else distribution.first_obstacle))
        for k in range(count)
    ]
    turns = rng.uniform(-1.0, 1.0, count) * distribution.obstacle_turn
    along = np.cumsum(gaps)
    # Lines are met on the straight path to the goal, square to it but for the turn.
    heading = np.arctan2(goal[1], goal[0])
    obstacles = np.stack(
        [along * np.cos(heading), along * np.sin(heading), np.pi / 2.0 + heading + turns], axis=-1
    ).reshape(count, 3)
    return Task(
        start_pose_W=np.zeros(3),
        start_feet_W=robot.nominal_feet_B[:, :2] + scatter,
        goal_pose_W=goal,
        obstacles_W=obstacles,
    )


def sample_noise(distribution: TaskDistribution, n_swings: int, rng: np.random.Generator) -> Noise:
    """Draw the smooth noise ξ̄ of one initial guess; ``n_swings`` is N̄_p."""
    scale = np.array(
        [distribution.noise_position, distribution.noise_position, distribution.noise_yaw]
    )
    harmonics = np.arange(1, 4)[:, None]
    return Noise(
        amplitudes=scale * rng.standard_normal((3, 3)) / harmonics,
        timing=distribution.noise_timing * rng.standard_normal((N_FEET, 2 * n_swings)),
    )


def gait_order(task: Task, robot: RobotModel) -> tuple[int, int, int, int]:
    """Feet in the order of their first swings: LH, LF, RH, RF, begun with the one furthest back.

    "Back" is measured along the start pose's x axis from the neutral position (Sec. 4.2).
    """
    walk = (2, 0, 3, 1)
    behind = task.start_feet_B()[:, 0] - robot.nominal_feet_B[:, 0]
    first = walk.index(int(np.argmin(behind)))
    order = walk[first:] + walk[:first]
    return order[0], order[1], order[2], order[3]
