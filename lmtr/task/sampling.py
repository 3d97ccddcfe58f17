"""The distribution of expert tasks 𝒳 and the smooth noise ξ̄ on initial guesses (Sec. 3.1, 4.2).

Everything random of one solution comes from one stream of :mod:`lmtr.streams`, by the solution's
index, so a data set is the same whatever the number of workers or the order in which they finish.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from lmtr.arrays import Array
from lmtr.errors import TaskError
from lmtr.robot.model import N_FEET, RobotModel
from lmtr.settings import NonNegative, PositiveRange, Settings, ascending
from lmtr.task.task import MAX_OBSTACLES, Task, require_array

HARMONICS = 3
"""Sines of smooth noise, the f-th of them f half waves long and 1/f high."""

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
        noise_timing: Standard deviation of independent noise on every contact change (s).
        noise_pace: Amplitude a of the noise on when a step is due, the same for all feet (s).
        noise_pairing: Most that the second and the fourth foot of the walk are moved ahead (s),
            all their steps alike; uniform from none. A quarter of a cycle (0.29 s) has them swing
            with the foot before them, two by two.
        noise_first_foot: Chance that another foot begins than the one furthest back.
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
    noise_timing: NonNegative = 0.03
    noise_pace: NonNegative = 0.05
    noise_pairing: NonNegative = 0.2
    noise_first_foot: Annotated[float, Field(ge=0.0, le=1.0)] = 0.3


@dataclass(frozen=True)
class Noise:
    """Smooth noise ξ̄ for one initial guess.

    Attributes:
        amplitudes: Factors a·N(0, 1)/f of sin(π·f·t/T̄) for f = 1, 2, 3 on the base's x, y (m)
            and yaw (rad), (harmonics, 3).
        timing: Offsets of the contact changes, slot by slot, in units of s, (4, 2·N̄_p).
        first: Place of the foot that begins, in the walk's order, after the one furthest back.
    """

    amplitudes: Array
    timing: Array
    first: int = 0

    def __post_init__(self) -> None:
        require_array("noise", "amplitudes", self.amplitudes, (HARMONICS, 3))
        require_array("noise", "timing", self.timing, (N_FEET, np.shape(self.timing)[-1]))
        if self.first not in range(N_FEET):
            raise TaskError(
                f"noise: first must be a place from 0 to {N_FEET - 1} in the walk's order, "
                f"got {self.first}; use 0 for the foot furthest back"
            )

    def require_scope(self, n_swings: int) -> None:
        """Refuse to be used for another number N̄_p of swings than it was drawn for.

        Raises:
            TaskError: There is not one offset for each contact change.
        """
        require_array("noise", "timing", self.timing, (N_FEET, 2 * n_swings))

    def on_base(self, phase: Array) -> Array:
        """Offsets of x, y (m) and yaw (rad) at times t = phase·T̄, (..., 3); zero at both ends."""
        return np.asarray(_sines(phase) @ self.amplitudes)


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
    """Draw the smooth noise ξ̄ of one initial guess; ``n_swings`` is N̄_p.

    Beyond the paper's noise on the base, the gait is noisy too: that is what makes different feet
    cross a line first, and with steps of different length (``docs/modes.md``).
    """
    position, yaw = distribution.noise_position, distribution.noise_yaw
    amplitudes = np.array([position, position, yaw]) * _falling(rng, 3)
    timing = distribution.noise_timing * rng.standard_normal((N_FEET, 2 * n_swings))
    pace = distribution.noise_pace * _falling(rng, 1)
    ahead = rng.uniform(0.0, distribution.noise_pairing) * np.array([[0.0], [1.0], [0.0], [1.0]])
    steps = (np.arange(n_swings) + np.arange(N_FEET)[:, None] / N_FEET) / n_swings
    gait = (_sines(steps) @ pace)[..., 0] - ahead
    another = rng.random() < distribution.noise_first_foot
    place = int(rng.integers(1, N_FEET))
    return Noise(amplitudes, timing + np.repeat(gait, 2, axis=1), place if another else 0)


def gait_order(task: Task, robot: RobotModel, first: int = 0) -> tuple[int, int, int, int]:
    """Feet in the order of their first swings: LH, LF, RH, RF, begun with the one furthest back.

    "Back" is measured along the start pose's x axis from the neutral position (Sec. 4.2).

    Args:
        task: The task.
        robot: Its neutral positions.
        first: Places by which the foot that begins comes after that one in the walk's order.
    """
    walk = (2, 0, 3, 1)
    behind = task.start_feet_B()[:, 0] - robot.nominal_feet_B[:, 0]
    begin = (walk.index(int(np.argmin(behind))) + first) % N_FEET
    order = walk[begin:] + walk[:begin]
    return order[0], order[1], order[2], order[3]


def _falling(rng: np.random.Generator, columns: int) -> Array:
    """Factors N(0, 1)/f of sines f = 1, 2, …, (harmonics, columns)."""
    return rng.standard_normal((HARMONICS, columns)) / np.arange(1, HARMONICS + 1)[:, None]


def _sines(phase: Array) -> Array:
    """Sines sin(π·f·phase), f = 1, 2, …, along a last axis; zero where the phase is 0 or 1."""
    return np.asarray(np.sin(np.pi * phase[..., None] * np.arange(1, HARMONICS + 1)))
