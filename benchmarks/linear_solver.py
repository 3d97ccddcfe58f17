"""Measure what the expert's own linear solver saves: the same solves with it and with MUMPS.

    python benchmarks/linear_solver.py --tasks 20

Functions, settings and guesses are the same, and solves take turns, so ratios stand for the linear
solver alone.
"""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table

from lmtr.expert.compilation import compiled, compiled_linear_solver
from lmtr.expert.formulation import Formulation, formulate, parameter_values
from lmtr.expert.initial_guess import initial_guess
from lmtr.expert.settings import ExpertSettings
from lmtr.expert.solver import InteriorPoint, Outcome
from lmtr.expert.variables import pack
from lmtr.robot.model import ROBOTS, RobotModel
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import TaskDistribution, sample_noise, sample_task
from services.cache import machine_cache


def main(
    tasks: Annotated[int, typer.Option(min=1, help="Tasks to solve.")] = 20,
    seed: Annotated[int, typer.Option(help="Seed of the task distribution.")] = 0,
    robot: Annotated[str, typer.Option(help=f"One of {', '.join(ROBOTS)}.")] = "anymal",
    cache: Annotated[Path | None, typer.Option(help="Folder of compiled problems.")] = None,
) -> None:
    """Solve tasks with both linear solvers in turn, and print a table."""
    console, settings, model = Console(), ExpertSettings(), ROBOTS[robot]
    problem, folder = formulate(model, settings), cache or machine_cache()
    functions, report = compiled(problem.functions.all(), folder)
    library, of_solver = compiled_linear_solver(problem, folder)
    if not (report.compiled and of_solver.compiled):
        raise typer.BadParameter((report + of_solver).reason, param_hint="--cache")
    by_name = {function.name(): function for function in functions}
    own = InteriorPoint(problem, by_name, settings.solver, library)
    mumps = InteriorPoint(problem, by_name, settings.solver, None)
    pairs: list[tuple[Outcome, Outcome]] = []
    for index in track(range(-1, tasks), console=console):
        start, parameters = _drawn(problem, model, settings, seed, max(index, 0))
        pair = own.solve(start, parameters), mumps.solve(start, parameters)
        if index >= 0:  # the first one only warms up
            pairs.append(pair)
    console.print(_table(pairs))


def _drawn(
    problem: Formulation, robot: RobotModel, settings: ExpertSettings, seed: int, index: int
) -> tuple[np.ndarray, np.ndarray]:
    """Start and parameters of one task."""
    distribution, rng = TaskDistribution(), stream(seed, Purpose.TASK, index)
    task = sample_task(distribution, robot, rng)
    noise = sample_noise(distribution, settings.scope.n_swings, rng)
    guess = initial_guess(task, noise, robot, settings.scope)
    parameters = parameter_values(task, guess, robot, settings, problem.parameters)
    return pack(guess, robot, settings.scope), parameters


def _table(pairs: list[tuple[Outcome, Outcome]]) -> Table:
    cpu = np.array([[outcome.cpu_s for outcome in pair] for pair in pairs])
    iterations = np.array([[outcome.iterations for outcome in pair] for pair in pairs])
    table = Table("median", "own", "MUMPS", "ratio", title="One linear solver and the other")
    for name, values in (
        ("CPU of a solve (s)", cpu),
        ("iterations", iterations),
        ("CPU of an iteration (ms)", 1e3 * cpu / iterations),
    ):
        ours, theirs = np.median(values, axis=0)
        ratio = np.median(values[:, 0] / values[:, 1])
        table.add_row(name, f"{ours:.3g}", f"{theirs:.3g}", f"{ratio:.2f}")
    equal = sum(a.status == b.status for a, b in pairs)
    table.caption = f"{equal} of {len(pairs)} end alike"
    return table


if __name__ == "__main__":
    typer.run(main)
