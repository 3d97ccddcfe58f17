"""Solves of a few tasks from many initial guesses each, as rows that a file can keep.

Two more kinds of solves tell whether modes are the problem's or the solver's. ``strict``: a guess
solved once more, all the way to the optimum. ``nudged``: from a guess that is almost the same, to
the usual tolerances and strictly.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from enum import StrEnum
from pathlib import Path

import numpy as np
from rich.progress import track

from benchmarks.kept import Row, read_rows, write_rows
from benchmarks.solving.circumstances import Circumstances, made_by
from benchmarks.solving.evidence import Evidence
from benchmarks.solving.evidence import solve as solve_task
from lmtr.arrays import Array
from lmtr.errors import ConfigurationError, DataError
from lmtr.expert.settings import ExpertSettings
from lmtr.expert.solve import Expert
from lmtr.quality.filter import QualityThresholds
from lmtr.robot.model import RobotModel
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import Noise, TaskDistribution, sample_noise, sample_task
from lmtr.task.task import Task
from lmtr.trajectory.trajectory import Trajectory

TASK_SEED = 777
"""Seed of the tasks."""

NOISE_SEED = 1000
"""Seed of the first draw of a task; later draws have the next ones."""

NUDGE = 0.02
"""Noise of a nudge over that of a draw: millimetres and milliseconds."""

CHECKED = 2
"""Draws of each task that are solved strictly and nudged too."""

_DIGITS = 6
"""Decimals that are kept of a trajectory's numbers."""


class Kind(StrEnum):
    """Kinds of solves."""

    DRAW = "draw"
    STRICT = "strict"
    NUDGED = "nudged"
    NUDGED_STRICT = "nudged_strict"


@dataclass(frozen=True)
class Walk:
    """One solve.

    Attributes:
        kind: Kind of the solve.
        index: Number of its task.
        draw: Number of its guess.
        iterations: Iterations of the solver.
        cpu_s: Processor time of the solve (s).
        reasons: Why the quality filter refuses it, empty if it is accepted; see :func:`judged`.
        first: Place of the first foot after the one furthest back.
        liftoff_swaps: Pairs of lift-offs that changed order during the solve.
        window_active: Whether a contact change lies on its window.
        evidence: Its task, its cost and what else the filter judges.
        trajectory: The solution.
    """

    kind: str
    index: int
    draw: int
    iterations: int
    cpu_s: float
    reasons: tuple[str, ...]
    first: int
    liftoff_swaps: int
    window_active: bool
    evidence: Evidence
    trajectory: Trajectory

    @property
    def cost(self) -> float:
        """Its cost."""
        return self.evidence.cost

    @property
    def obstacles_W(self) -> Array:
        """Lines of its task, (n, 3)."""
        return self.evidence.task.obstacles_W

    @property
    def accepted(self) -> bool:
        """Whether the quality filter accepts it."""
        return not self.reasons


@dataclass(frozen=True)
class Study:
    """Which solves there are.

    Attributes:
        robot: The robot.
        distribution: Distribution of tasks and noise.
        settings: Settings of the expert.
        tasks: Number of tasks.
        draws: Guesses of each.
    """

    robot: RobotModel
    distribution: TaskDistribution
    settings: ExpertSettings
    tasks: int
    draws: int

    def __post_init__(self) -> None:
        if self.distribution.obstacle_count[0] < 1:
            raise ConfigurationError(
                "diversity: every task needs a line to cross, got tasks.obstacle_count = "
                f"{self.distribution.obstacle_count}; raise its lower end"
            )

    def drawn(self, index: int, draw: int) -> tuple[Task, Noise]:
        """A task and one of its draws of noise."""
        task = sample_task(self.distribution, self.robot, stream(TASK_SEED, Purpose.TASK, index))
        rng = stream(NOISE_SEED + draw, Purpose.TASK, index)
        return task, sample_noise(self.distribution, self.settings.scope.n_swings, rng)

    def nudged(self, index: int, draw: int) -> tuple[Task, Noise]:
        """The same with a little of another draw's noise on top, and the same first foot."""
        task, noise = self.drawn(index, draw)
        _, other = self.drawn(index, self.draws + draw)
        return task, replace(
            noise,
            amplitudes=noise.amplitudes + NUDGE * other.amplitudes,
            timing=noise.timing + NUDGE * other.timing,
        )


def strict(settings: ExpertSettings) -> ExpertSettings:
    """The same problem, solved to the optimum and never stopped early."""
    solver = settings.solver.model_copy(
        update={"early_objective_change": 1e-9, "tolerance": 1e-4, "max_iterations": 500}
    )
    return settings.model_copy(update={"solver": solver})


def solve_all(study: Study, usual: Expert, exact: Expert) -> list[Walk]:
    """Solve everything, one after the other.

    Args:
        study: Which solves there are.
        usual: Expert of its settings.
        exact: That of the strict ones.
    """
    jobs: list[tuple[Kind, int, int]] = [
        (Kind.DRAW, index, draw) for index in range(study.tasks) for draw in range(study.draws)
    ]
    jobs += [
        (kind, index, draw)
        for kind in (Kind.STRICT, Kind.NUDGED, Kind.NUDGED_STRICT)
        for index in range(study.tasks)
        for draw in range(min(CHECKED, study.draws))
    ]
    walks = []
    for kind, index, draw in track(jobs, "Solving", transient=True):
        expert = exact if kind in (Kind.STRICT, Kind.NUDGED_STRICT) else usual
        walks.append(solve(study, expert, kind, index, draw))
    return walks


def solve(study: Study, expert: Expert, kind: Kind, index: int, draw: int) -> Walk:
    """Solve one task from one guess."""
    pick: Callable[[int, int], tuple[Task, Noise]] = (
        study.drawn if kind in (Kind.DRAW, Kind.STRICT) else study.nudged
    )
    task, noise = pick(index, draw)
    solution, evidence = solve_task(expert, task, noise)
    return Walk(
        kind=str(kind),
        index=index,
        draw=draw,
        iterations=solution.iterations,
        cpu_s=solution.solve_cpu_s,
        reasons=(),
        first=noise.first,
        liftoff_swaps=solution.liftoff_swaps,
        window_active=solution.window_active,
        evidence=evidence,
        trajectory=solution.trajectory,
    )


def judged(
    walks: Sequence[Walk],
    robot: RobotModel,
    settings: ExpertSettings,
    thresholds: QualityThresholds,
) -> list[Walk]:
    """The same with the filter's present reasons.

    Args:
        walks: The walks.
        robot: The robot.
        settings: Settings of the expert.
        thresholds: What solutions may show.
    """
    key = settings.cost_key(robot)
    return [replace(w, reasons=w.evidence.reasons(robot, key, thresholds)) for w in walks]


def write(path: Path, made: Circumstances, walks: Sequence[Walk]) -> None:
    """Keep walks in a file, under what made them and without the filter's verdict."""
    rows = []
    for walk in walks:
        row = {f.name: getattr(walk, f.name) for f in fields(walk) if f.name != "reasons"}
        row["evidence"] = walk.evidence.as_row()
        row["trajectory"] = {
            name: np.round(array, _DIGITS).tolist()
            for name, array in asdict(walk.trajectory).items()
        }
        rows.append(row)
    write_rows(path, {"circumstances": asdict(made)}, rows)


def read(path: Path) -> tuple[Circumstances, list[Walk]]:
    """What made the walks that :func:`write` kept, and these, not judged yet.

    Raises:
        DataError: There are none, or of another form.
    """
    head, rows = read_rows(path, "diversity")
    made = made_by(head, "diversity")
    try:
        return made, [_walk(row) for row in rows]
    except (KeyError, TypeError) as error:
        raise DataError(
            f"diversity: the solves in {path} are of another form ({error}); solve once more"
        ) from error


def _walk(row: Row) -> Walk:
    nodes = {name: np.array(values) for name, values in row["trajectory"].items()}
    kept = {"evidence": Evidence.from_row(row["evidence"]), "trajectory": Trajectory(**nodes)}
    return Walk(**row | kept | {"reasons": ()})
