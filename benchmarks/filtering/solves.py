"""Solves of three kinds of tasks, as rows of figures that a file can keep.

``default``: the tasks of a data set. ``varied``: up to four lines and goals near and far, where
hard tasks stand out. ``draws``: a few tasks, each from several initial guesses, where the best of
them tells what the others might have cost.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np
from rich.progress import track

from benchmarks.kept import read_rows, write_rows
from benchmarks.solving.circumstances import Circumstances, made_by
from lmtr.arrays import Array
from lmtr.expert.solve import Expert
from lmtr.quality.cost_model import task_features
from lmtr.quality.measure import Violations, measure
from lmtr.quality.status import Status
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import TaskDistribution, sample_noise, sample_task


class Kind(StrEnum):
    """Kinds of tasks."""

    DEFAULT = "default"
    VARIED = "varied"
    DRAWS = "draws"


DISTRIBUTIONS = {
    Kind.DEFAULT: TaskDistribution(),
    Kind.VARIED: TaskDistribution(obstacle_count=(0, 4), goal_distance=(0.5, 3.6)),
    Kind.DRAWS: TaskDistribution(),
}
SEEDS = {Kind.DEFAULT: 12345, Kind.VARIED: 54321, Kind.DRAWS: 777}
NOISE_SEED = 1000
"""Seed of the first noise draw of a task; later draws have the next ones."""


@dataclass(frozen=True)
class Amount:
    """How many solves there are of each kind.

    Attributes:
        default: Default tasks.
        varied: Varied tasks.
        repeated: Tasks that are solved from several guesses.
        draws: Guesses of each of these.
    """

    default: int
    varied: int
    repeated: int
    draws: int

    def jobs(self) -> Iterator[tuple[Kind, int, int]]:
        """Kind, index and noise draw of every solve."""
        yield from ((Kind.DEFAULT, index, 0) for index in range(self.default))
        yield from ((Kind.VARIED, index, 0) for index in range(self.varied))
        yield from (
            (Kind.DRAWS, index, draw)
            for index in range(self.repeated)
            for draw in range(self.draws)
        )


@dataclass(frozen=True)
class Solve:
    """One solve in figures.

    Attributes:
        kind: Kind of its task.
        index: Number of its task among those of the kind.
        draw: Number of its initial guess.
        status: Outcome.
        cost: Cost.
        distance: From start to goal (m).
        lines: Number of obstacle lines.
        features: Features of its task, see ``task_features``.
        saturated: Limits that it lies on.
        figures: Its violations by name.
    """

    kind: str
    index: int
    draw: int
    status: str
    cost: float
    distance: float
    lines: int
    features: tuple[float, ...]
    saturated: tuple[str, ...]
    figures: dict[str, float]

    @property
    def violations(self) -> Violations:
        """Its violations as the filter takes them."""
        return Violations.from_dict(self.figures)


def of_kind(solves: Sequence[Solve], *kinds: Kind) -> list[Solve]:
    """The converged solves of tasks of these kinds."""
    return [s for s in solves if s.kind in kinds and s.status == Status.CONVERGED]


def costs(solves: Sequence[Solve]) -> Array:
    """Costs, (n,)."""
    return np.array([s.cost for s in solves])


def features(solves: Sequence[Solve]) -> Array:
    """Features of the tasks, (n, 5)."""
    return np.array([s.features for s in solves])


def solve_all(expert: Expert, amount: Amount) -> list[Solve]:
    """Solve tasks of all kinds, one after the other."""
    jobs = list(amount.jobs())
    return [solve(expert, *job) for job in track(jobs, "Solving", transient=True)]


def solve(expert: Expert, kind: Kind, index: int, draw: int) -> Solve:
    """Solve one task from one guess."""
    distribution, robot = DISTRIBUTIONS[kind], expert.robot
    rng = stream(SEEDS[kind], Purpose.TASK, index)
    task = sample_task(distribution, robot, rng)
    if kind is Kind.DRAWS:
        rng = stream(NOISE_SEED + draw, Purpose.TASK, index)
    solution = expert.solve(task, sample_noise(distribution, expert.settings.scope.n_swings, rng))
    return Solve(
        kind=str(kind),
        index=index,
        draw=draw,
        status=str(solution.status),
        cost=solution.cost,
        distance=float(np.linalg.norm(task.goal_pose_W[:2] - task.start_pose_W[:2])),
        lines=len(task.obstacles_W),
        features=tuple(task_features(task, robot).tolist()),
        saturated=solution.saturated,
        figures=measure(solution.trajectory, robot, task.obstacles_W).as_dict(),
    )


def write(path: Path, made: Circumstances, cost_key: str, solves: Sequence[Solve]) -> None:
    """Keep solves in a file, under what made them and the digest of what costs depend on."""
    head = {"circumstances": asdict(made), "cost_key": cost_key}
    write_rows(path, head, [asdict(s) for s in solves])


def read(path: Path) -> tuple[Circumstances, str, list[Solve]]:
    """What made the solves that :func:`write` kept, the digest of costs, and the solves.

    Raises:
        DataError: There are none.
    """
    head, rows = read_rows(path, "thresholds")
    solves = [
        Solve(**row | {name: tuple(row[name]) for name in ("features", "saturated")})
        for row in rows
    ]
    return made_by(head, "thresholds"), head["cost_key"], solves
