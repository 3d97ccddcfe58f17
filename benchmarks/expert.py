"""Measure the expert: processor time, iterations, convergence and obstacle avoidance.

    python benchmarks/expert.py --tasks 50 --out expert.json

Tasks and noise are those of a data set with the same seed, so two runs differ in nothing but time.
The second round, without the obstacle cost, shows what that cost does to the closest foothold.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table

from lmtr.expert.settings import ExpertSettings
from lmtr.expert.solve import Expert, Status
from lmtr.quality.kinematics import closest_footholds
from lmtr.robot.model import ROBOTS
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import TaskDistribution, sample_noise, sample_task

Row = dict[str, float]

UNITS = {
    "cpu_s": "CPU (s)",
    "iterations": "iterations",
    "cost": "cost",
    "closest_foothold_m": "closest foothold to a line (m)",
    "liftoff_swaps": "lift-offs swapped",
}


def main(
    tasks: Annotated[int, typer.Option(min=1, help="Tasks per round.")] = 50,
    seed: Annotated[int, typer.Option(help="Seed of the task distribution.")] = 0,
    robot: Annotated[str, typer.Option(help=f"One of {', '.join(ROBOTS)}.")] = "anymal",
    cache: Annotated[Path, typer.Option(help="Folder of compiled problems.")] = Path(".cache"),
    interpret: Annotated[bool, typer.Option(help="Do not compile.")] = False,
    out: Annotated[Path | None, typer.Option(help="JSON file with every solve.")] = None,
) -> None:
    """Solve tasks with and without the obstacle cost, and print a table."""
    settings = ExpertSettings()
    console, report = Console(), {}
    for name, weight in (("with", settings.obstacle_weight), ("without", 0.0)):
        expert = Expert(
            ROBOTS[robot],
            settings.model_copy(update={"obstacle_weight": weight}),
            None if interpret else cache,
        )
        build = expert.build_report
        console.print(
            f"obstacle cost {name}: {'compiled' if build.compiled else 'interpreted'}"
            f"{', from cache' if build.cached else ''} ({build.seconds:.1f} s) {build.reason}"
        )
        rows = [solve(expert, seed, index) for index in track(range(tasks), console=console)]
        console.print(table(f"{robot}, obstacle cost {name}", rows))
        report[name] = rows
    if out is not None:
        content = {"robot": robot, "seed": seed, "settings": settings.model_dump(), "rows": report}
        out.write_text(json.dumps(content, indent=1))


def solve(expert: Expert, seed: int, index: int) -> Row:
    """Figures of one solve."""
    distribution, rng = TaskDistribution(), stream(seed, Purpose.TASK, index)
    task = sample_task(distribution, expert.robot, rng)
    noise = sample_noise(distribution, expert.settings.scope.n_swings, rng)
    solution, lines = expert.solve(task, noise), task.obstacles_W
    return {
        "index": index,
        "converged": float(solution.status == Status.CONVERGED),
        "cpu_s": solution.solve_cpu_s,
        "iterations": solution.iterations,
        "cost": solution.cost,
        "closest_foothold_m": min(closest_footholds(solution.trajectory, lines), default=np.inf),
        "liftoff_swaps": solution.liftoff_swaps,
        "window_active": float(solution.window_active),
        "violation": max(solution.constraint_violation.values()),
    }


def table(title: str, rows: Sequence[Row]) -> Table:
    """Quantiles over all solves."""
    shown = Table("", "p10", "median", "p90", "worst", title=title)
    for key, label in UNITS.items():
        values = np.array([row[key] for row in rows])
        worst = values.min() if key == "closest_foothold_m" else values.max()
        quantiles = [*np.quantile(values, [0.1, 0.5, 0.9]), worst]
        shown.add_row(label, *[f"{value:.3g}" for value in quantiles])
    converged = int(sum(row["converged"] for row in rows))
    touched = int(sum(row["window_active"] for row in rows))
    shown.caption = (
        f"{converged} of {len(rows)} converged ({converged / len(rows):.1%}); "
        f"{touched} touch a timing window"
    )
    return shown


if __name__ == "__main__":
    typer.run(main)
