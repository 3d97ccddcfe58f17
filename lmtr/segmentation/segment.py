"""Segments of a solution: random epochs, and several goals for each (Sec. 3.1)."""

from dataclasses import dataclass

import numpy as np
from pydantic import model_validator

from lmtr.arrays import Array
from lmtr.segmentation.window import cut, valid_epochs
from lmtr.settings import Count, Positive, Settings
from lmtr.trajectory.sample import sample_base
from lmtr.trajectory.trajectory import Trajectory
from lmtr.vectors.layout import SEGMENT_DURATION
from lmtr.vectors.segment_vector import encode_segment
from lmtr.vectors.state import state_at
from lmtr.vectors.task_vector import encode_task

_DRAWS_PER_EPOCH = 4
"""Epochs drawn for each one wanted: about one in twelve is no window, more where gaits differ."""


class SegmentationSettings(Settings):
    """How many segments a solution yields, and how far ahead their goals lie.

    Attributes:
        epochs_per_solution: Windows per solution, at random times; fewer where a solution has
            hardly any valid ones.
        goals_per_epoch: Goals γ for each window: rows that share τ but not x.
        goal_horizon: Nearest and furthest goal after the epoch (s), cut off at the solution's end.
            Replanners are asked for goals at the distances that the base covers in these times.
    """

    epochs_per_solution: Count = 15
    goals_per_epoch: Count = 2
    goal_horizon: tuple[Positive, Positive] = (1.0, 4.0)

    @model_validator(mode="after")
    def _goals_lie_beyond_the_window(self) -> "SegmentationSettings":
        nearest, furthest = self.goal_horizon
        if not SEGMENT_DURATION <= nearest <= furthest:
            raise ValueError(
                f"goal_horizon must ascend from at least the window's {SEGMENT_DURATION} s, "
                f"got {self.goal_horizon}; choose later goals"
            )
        return self


@dataclass(frozen=True)
class Segments:
    """n pairs (x, τ) from one solution, windows in the order of their drawing.

    Attributes:
        epoch_s: Start of the window, (n,) in s.
        goal_time_s: When the solution reaches the goal γ, (n,) in s.
        x: Task vectors, (n, 35).
        tau: Segment vectors, (n, 264).
    """

    epoch_s: Array
    goal_time_s: Array
    x: Array
    tau: Array


def segment_solution(
    trajectory: Trajectory,
    obstacles_W: Array,
    settings: SegmentationSettings,
    rng: np.random.Generator,
) -> Segments:
    """Cut one solution at random epochs, and give each window several goals.

    Args:
        trajectory: One solution (no batch axes), world frame.
        obstacles_W: Its obstacle lines, (n_lines, 3).
        settings: Numbers of epochs and goals.
        rng: Stream of this solution.

    Returns:
        At most ``epochs_per_solution`` · ``goals_per_epoch`` rows; none from a solution that has
        no valid window.
    """
    epochs = _draw_epochs(trajectory, settings, rng)
    tau = encode_segment(cut(trajectory, epochs))
    goal_time = _draw_goal_times(trajectory, epochs, settings, rng)
    goal = sample_base(trajectory, goal_time)
    goal_W = np.concatenate([goal.position[:, :2], goal.rpy[:, 2:]], axis=-1)
    epochs = np.repeat(epochs, settings.goals_per_epoch)
    return Segments(
        epoch_s=epochs,
        goal_time_s=goal_time,
        x=encode_task(state_at(trajectory, epochs), obstacles_W, goal_W),
        tau=np.repeat(tau, settings.goals_per_epoch, axis=0),
    )


def _draw_epochs(
    trajectory: Trajectory, settings: SegmentationSettings, rng: np.random.Generator
) -> Array:
    """Uniform epochs, without those that make no window."""
    latest = max(float(trajectory.base_start), float(trajectory.base_end) - SEGMENT_DURATION)
    count = _DRAWS_PER_EPOCH * settings.epochs_per_solution
    drawn = rng.uniform(float(trajectory.base_start), latest, count)
    return drawn[valid_epochs(trajectory, drawn)][: settings.epochs_per_solution]


def _draw_goal_times(
    trajectory: Trajectory, epochs: Array, settings: SegmentationSettings, rng: np.random.Generator
) -> Array:
    """Times of the goals, (E · goals_per_epoch,) in s, uniform between the horizons."""
    nearest, furthest = settings.goal_horizon
    left = (trajectory.base_end - epochs)[:, None]
    low, high = np.minimum(nearest, left), np.minimum(furthest, left)
    share = rng.uniform(size=(len(epochs), settings.goals_per_epoch))
    return np.asarray(epochs[:, None] + low + share * (high - low)).reshape(-1)
