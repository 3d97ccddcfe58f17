"""Generate with a solver that costs next to nothing, to measure all that is around the solver.

    python -m benchmarks.synthetic --home /tmp/synthetic --solutions 100000 --workers 2
    python -m benchmarks.synthetic --home /tmp/synthetic --solutions 2000 --delay 0.05

Tasks, rows, workers, writer and lake are the real ones; a solution is the initial guess, with
figures drawn from the task. Its data set is called ``synthetic``, so that it is never taken for one
of the expert's.
"""

import functools
import hashlib
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from lmtr.errors import LmtrError
from lmtr.expert.initial_guess import initial_guess
from lmtr.expert.settings import ExpertSettings
from lmtr.expert.solve import Solution, Status
from lmtr.robot.model import RobotModel
from lmtr.task.sampling import Noise
from lmtr.task.task import Task
from pipelines.config import Configuration, load
from pipelines.generate import generate
from pipelines.progress import say
from pipelines.workspace import Workspace
from services.errors import ServiceError

TERMS = ("base", "force", "foothold")
"""Names of the terms that a cost is split into."""

FAILING = 0.02
"""Share of the solves that do not converge."""


@dataclass(frozen=True)
class SyntheticExpert:
    """Solves like the expert, without solving: the same numbers for the same task.

    Attributes:
        robot: The robot.
        settings: Of the expert whose place it takes; the scope decides the trajectory.
        delay: Sleep that a solve takes (s).
    """

    robot: RobotModel
    settings: ExpertSettings
    delay: float = 0.0

    def solve(self, task: Task, noise: Noise) -> Solution:
        """The initial guess, with plausible figures."""
        started = time.process_time()
        guess = initial_guess(task, noise, self.robot, self.settings.scope)
        rng = np.random.default_rng(_seed(task, noise))
        terms = dict(zip(TERMS, rng.gamma(2.0, 5.0, len(TERMS)).tolist(), strict=True))
        converged = bool(rng.random() >= FAILING)
        if self.delay:
            time.sleep(self.delay)
        return Solution(
            status=Status.CONVERGED if converged else Status.ITERATION_LIMIT,
            message="synthetic",
            iterations=int(rng.integers(20, 80)),
            cost=sum(terms.values()),
            cost_terms=terms,
            constraint_violation={"bounds": float(rng.exponential(1e-8))},
            solve_cpu_s=time.process_time() - started,
            trajectory=guess.trajectory,
            guess=guess.trajectory,
            order=guess.order,
            liftoff_swaps=int(rng.integers(0, 3)),
            saturated=(),
        )


def make_synthetic(config: Configuration, delay: float = 0.0) -> SyntheticExpert:
    """The solver of a configuration; with ``functools.partial`` it travels to workers."""
    return SyntheticExpert(config.dataset.robot, config.expert, delay)


def synthetic_configuration(
    source: str | None, overrides: Sequence[str], solutions: int, workers: int | None
) -> Configuration:
    """A configuration whose data set cannot be taken for one of the expert's."""
    own = ["dataset.name=synthetic", f"dataset.solutions={solutions}"]
    if workers is not None:
        own.append(f"cluster.workers={workers}")
    return load(source, [*overrides, *own])


def _seed(task: Task, noise: Noise) -> int:
    content = task.start_pose_W.tobytes() + task.goal_pose_W.tobytes() + noise.timing.tobytes()
    return int.from_bytes(hashlib.blake2b(content, digest_size=8).digest(), "little")


def main(
    home: Annotated[Path, typer.Option(help="Folder that the lake is made in.")],
    solutions: Annotated[int, typer.Option("--solutions", "-n", min=1)] = 1000,
    workers: Annotated[int | None, typer.Option("--workers", "-w", min=0)] = None,
    config: Annotated[str | None, typer.Option("--config", "-c", help="Name or TOML file.")] = None,
    overrides: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Override a setting.")
    ] = None,
    delay: Annotated[float, typer.Option(min=0.0, help="Sleep of a solve (s).")] = 0.0,
) -> None:
    """Generate; exit statuses are those of ``lmtr generate``."""
    try:
        settings = synthetic_configuration(config, overrides or (), solutions, workers)
        space = Workspace.open(home, settings.cluster, create=True)
        generate(settings, space, functools.partial(make_synthetic, delay=delay))
    except (LmtrError, ServiceError, OSError) as error:
        say(f"synthetic: {error}")
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    # Workers must find this module by its name, not as the script that was started.
    from benchmarks import synthetic

    typer.run(synthetic.main)
