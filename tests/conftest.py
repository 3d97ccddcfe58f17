"""For all tests: walks that need no optimizer, and servers that speak S3."""

import os
import subprocess
import sys
import uuid
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from hypothesis import settings
from s3_servers import S3Server, moto_server, radosgw_server

from lmtr.expert.initial_guess import base_control_points, initial_guess
from lmtr.expert.settings import Scope
from lmtr.models.data import TrainingData
from lmtr.robot.model import ANYMAL
from lmtr.segmentation.segment import SegmentationSettings, segment_solution
from lmtr.spline.bspline import hermite_nodes
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import TaskDistribution, sample_noise, sample_task
from lmtr.task.task import Task
from lmtr.trajectory.trajectory import BASE_STEP, Trajectory

# A test's outcome depends neither on the machine's speed nor on the day.
settings.register_profile("lmtr", deadline=None, derandomize=True)
settings.load_profile("lmtr")


@dataclass(frozen=True)
class Walk:
    """A task and a walk towards its goal: 7.5 s, 7 stances per foot, world frame."""

    task: Task
    trajectory: Trajectory


def started_gently(path: np.ndarray) -> np.ndarray:
    """Control points (n, D) run through from rest to rest, a second to start and one to stop.

    The guess sets off at full speed from its third control point, which no robot does.
    """
    intervals = np.arange(len(path) - 1)
    ramp = np.clip((np.minimum(intervals, intervals[::-1]) - 1.0) / 10.0, 0.0, 1.0)
    travelled = np.concatenate([[0.0], np.cumsum(np.sin(np.pi / 2.0 * ramp) ** 2)])
    at = 2.0 + (len(path) - 5) * travelled / travelled[-1]
    return np.stack([np.interp(at, np.arange(len(path)), column) for column in path.T], axis=-1)


@cache
def make_walk(seed: int) -> Walk:
    """The expert's noisy first guess, made livelier: swaying base, forces in all directions."""
    rng, scope = stream(seed, Purpose.TASK, 0), Scope()
    distribution = TaskDistribution()
    task = sample_task(distribution, ANYMAL, rng)
    noise = sample_noise(distribution, scope.n_swings, rng)
    guess = initial_guess(task, noise, ANYMAL, scope).trajectory
    control = started_gently(base_control_points(task, noise, ANYMAL, scope))
    phase = np.pi * (np.arange(len(control)) - 2.0)[:, None] / (len(control) - 5)
    sway = rng.normal(size=(4, 3)) * np.array([0.01, 0.03, 0.02])
    control[:, 2:5] += started_gently(np.sin(phase * np.arange(1, 5))) @ sway
    free = guess.force_nodes[..., :1, 2:] > 0.0
    wobble = rng.normal(size=guess.force_nodes.shape) * np.array([[20.0], [100.0]])
    return Walk(
        task,
        replace(
            guess,
            base_nodes=hermite_nodes(control, BASE_STEP),
            force_nodes=guess.force_nodes + np.where(free, wobble, 0.0),
        ),
    )


@pytest.fixture(scope="session")
def walk() -> Callable[[int], Walk]:
    """Walks by seed."""
    return make_walk


@pytest.fixture(scope="session")
def walk_segments(walk: Callable) -> TrainingData:
    """Segments of six walks."""
    rng, settings = np.random.default_rng(0), SegmentationSettings(epochs_per_solution=10)
    parts = [
        segment_solution(w.trajectory, w.task.obstacles_W, settings, rng)
        for w in map(walk, range(6))
    ]
    return TrainingData(
        np.concatenate([p.x for p in parts]), np.concatenate([p.tau for p in parts])
    )


@pytest.fixture(scope="session")
def moto() -> Iterator[S3Server]:
    """Moto's S3 server."""
    with moto_server() as server:
        yield server


@pytest.fixture(scope="session")
def radosgw(tmp_path_factory) -> Iterator[S3Server]:
    """A real S3 server."""
    with radosgw_server(tmp_path_factory.mktemp("ceph")) as server:
        yield server


@pytest.fixture
def reach(monkeypatch, tmp_path) -> Callable[[S3Server], None]:
    """Sets the environment so that a server is reached, and companion folders lie apart."""

    def set_environment(server: S3Server) -> None:
        monkeypatch.setenv("LMTR_STATE", str(tmp_path / "state"))
        for name in [name for name in os.environ if name.startswith(("AWS_", "MLFLOW_TRACKING"))]:
            monkeypatch.delenv(name)
        for name, value in server.environment.items():
            monkeypatch.setenv(name, value)

    return set_environment


@pytest.fixture
def prefix() -> str:
    """A prefix of the bucket that nobody else uses."""
    return f"p{uuid.uuid4().hex[:12]}"


@pytest.fixture
def spawn() -> Callable[..., "subprocess.Popen[str]"]:
    """Runs Python source in a process of its own."""

    def start(source: str, *arguments: object) -> "subprocess.Popen[str]":
        return subprocess.Popen(
            [sys.executable, "-c", source, *map(str, arguments)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    return start
