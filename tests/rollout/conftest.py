"""Replanners that need no training: one replays a long walk, one looks segments up in a library."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from lmtr.expert.initial_guess import initial_guess
from lmtr.expert.settings import Scope
from lmtr.robot.model import ANYMAL
from lmtr.rollout.settings import RolloutSettings
from lmtr.segmentation.segment import SegmentationSettings, segment_solution
from lmtr.segmentation.window import cut
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import TaskDistribution, sample_noise
from lmtr.task.task import Task
from lmtr.trajectory.motion import Footholds, Motion
from lmtr.trajectory.trajectory import BASE_STEP, Trajectory
from lmtr.vectors.segment_vector import encode_segment

FIRST_EPOCH = 0.5


@cache
def long_walk(index: int) -> Trajectory:
    """A walk of 9 s over 3 m with noise on path and timing."""
    scope = Scope(duration=9.0, n_swings=6)
    goal = np.array([3.0, 0.4, 0.3])
    task = Task(np.zeros(3), ANYMAL.nominal_feet_B[:, :2], goal, np.zeros((0, 3)))
    noise = sample_noise(TaskDistribution(noise_position=0.1), 6, stream(5, Purpose.TASK, index))
    return initial_guess(task, noise, ANYMAL, scope).trajectory


@dataclass
class Oracle:
    """Knows the walks that its batch is on, and returns their windows one after the other."""

    walks: list[Trajectory]
    settings: RolloutSettings
    name: str = "oracle"
    nbytes: int = 0
    cycle: int = 0

    def windows(self, cycle: int) -> np.ndarray:
        epoch = np.array([FIRST_EPOCH + self.settings.period * cycle])
        return np.concatenate([encode_segment(cut(walk, epoch)) for walk in self.walks])

    def plan(self, x: np.ndarray) -> np.ndarray:
        self.cycle += 1
        return self.windows(self.cycle - 1)

    def describe(self) -> dict:
        return {}


@dataclass
class Library:
    """The nearest stored task's segment: plans disagree with the motion about many contacts."""

    x: np.ndarray
    tau: np.ndarray
    name: str = "library"
    nbytes: int = 0

    def plan(self, x: np.ndarray) -> np.ndarray:
        scale = self.x.std(axis=0) + 1e-3
        distance = np.abs((x[:, None] - self.x) / scale).sum(axis=-1)
        return self.tau[distance.argmin(axis=-1)]

    def describe(self) -> dict:
        return {}


@pytest.fixture(scope="session")
def short() -> RolloutSettings:
    """Six seconds: 20 cycles."""
    return RolloutSettings(duration=6.0)


@pytest.fixture(scope="session")
def library(walk: Callable) -> Library:
    settings = SegmentationSettings(epochs_per_solution=8)
    segments = [
        segment_solution(
            made.trajectory, made.task.obstacles_W, settings, stream(7, Purpose.SEGMENTS, index)
        )
        for index, made in ((index, walk(index)) for index in range(12))
    ]
    return Library(
        np.concatenate([s.x for s in segments]), np.concatenate([s.tau for s in segments])
    )


@pytest.fixture
def oracle(short: RolloutSettings) -> Oracle:
    return Oracle([long_walk(index) for index in range(3)], short)


def make_standing(samples: int = 11, force_share: float = 1.0) -> Motion:
    """At rest over its feet in neutral stance, each of which bears a quarter of the weight."""
    base = np.tile([0.0, 0.0, ANYMAL.nominal_height], (samples, 1))
    force = np.zeros((samples, 4, 3))
    force[..., 2] = 0.25 * force_share * ANYMAL.weight
    return Motion(
        times=BASE_STEP * np.arange(samples),
        base_position_W=base,
        base_rpy=np.zeros((samples, 3)),
        base_velocity_W=np.zeros((samples, 3)),
        base_angular_velocity_W=np.zeros((samples, 3)),
        foot_position_W=np.tile(ANYMAL.nominal_feet_B, (samples, 1, 1)) + base[:, None],
        foot_force_W=force,
        contact=np.ones((samples, 4), dtype=bool),
        footholds=Footholds(np.zeros(0, dtype=int), np.zeros((0, 2)), np.zeros(0), np.zeros(0)),
    )


@pytest.fixture
def standing() -> Callable[..., Motion]:
    """Motions of a robot that stands still."""
    return make_standing
