"""What balancing forces in the mean, rather than at the nodes, leaves between them.

    python benchmarks/balance.py --out build/balance.png
    python benchmarks/balance.py --record  # the picture of docs/formulation.md

Solves one default task, takes the vertical force of its solution, and compares the acceleration
that the solution has with the one that would match this force at every node (the chord between
nodes). Draws both residuals, and what they add up to (E15–E17).
"""

from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.console import Console
from scipy.integrate import cumulative_trapezoid

from benchmarks.solving.ready import ready_expert
from lmtr.arrays import Array
from lmtr.errors import LmtrError
from lmtr.expert.settings import ExpertSettings
from lmtr.figures.style import FULL_WIDTH, save, series_styles, styled
from lmtr.quality.residual import linear_residual, rigid_motion
from lmtr.robot.model import ANYMAL
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import TaskDistribution, sample_noise, sample_task
from lmtr.trajectory.sample import sample_feet
from lmtr.trajectory.trajectory import BASE_STEP, Trajectory

PICTURE = Path(__file__).resolve().parent.parent / "docs" / "images" / "balance.png"

SAMPLES_PER_KNOT = 100
"""Samples from one node to the next."""

SHOWN = (3.0, 4.0)
"""Time of the walk that residuals are drawn for (s)."""

MEANS, NODES = "in the mean around nodes", "at the nodes"

console = Console()


class Residuals(NamedTuple):
    """Vertical acceleration that forces ask for beyond the base's, over a walk.

    Attributes:
        times: Samples, (M,) in s.
        by_rule: Residual if the balance holds as named, (M,) in m/s² each.
    """

    times: Array
    by_rule: dict[str, Array]

    def velocity_error(self, rule: str) -> Array:
        """What the residual adds up to if forces are carried out open loop, (M,) in m/s."""
        return np.asarray(cumulative_trapezoid(self.by_rule[rule], self.times, initial=0.0))


def solved(index: int, cache: Path | None) -> Trajectory:
    """Solution of a task of the default distribution, by number."""
    settings, distribution = ExpertSettings(), TaskDistribution()
    rng = stream(0, Purpose.TASK, index)
    task = sample_task(distribution, ANYMAL, rng)
    noise = sample_noise(distribution, settings.scope.n_swings, rng)
    return ready_expert(ANYMAL, settings, cache, console).solve(task, noise).trajectory


def residuals(trajectory: Trajectory) -> Residuals:
    """Residuals of a solution, and of a base that matches its forces at the nodes."""
    count = (len(trajectory.base_nodes) - 1) * SAMPLES_PER_KNOT + 1
    times: Array = BASE_STEP / SAMPLES_PER_KNOT * np.arange(count, dtype=np.float64)
    motion, feet = rigid_motion(trajectory, times), sample_feet(trajectory, times)
    left = -linear_residual(motion, feet, ANYMAL)[:, 2]
    asked = left + motion.acceleration[:, 2]
    nodes = slice(None, None, SAMPLES_PER_KNOT)
    chord = np.interp(times, times[nodes], asked[nodes])
    return Residuals(times, {NODES: asked - chord, MEANS: left})


@styled
def picture(found: Residuals) -> Figure:
    """Residuals over a second, and what they add up to over the walk."""
    figure = Figure(figsize=(FULL_WIDTH, 3.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    shown = (SHOWN[0] <= found.times) & (found.times <= SHOWN[1])
    for rule, style in series_styles(found.by_rule).items():
        look = {"color": style.colour, "linestyle": style.line, "label": f"balance {rule}"}
        left.plot(found.times[shown], found.by_rule[rule][shown], **look)
        right.plot(found.times, 1e3 * found.velocity_error(rule), **look)
    _name(left, "Vertical residual", "time (s), nodes at the grid", "e · g (m/s²)")
    left.set_xticks(np.arange(SHOWN[0], SHOWN[1] + BASE_STEP / 2, BASE_STEP))
    _name(right, "What it adds up to", "time (s)", "error of velocity (mm/s)")
    low, high = right.get_ylim()
    right.set_ylim(low - 0.3 * (high - low), high)  # room for the legend
    right.legend(loc="lower right", ncols=2)
    return figure


def _name(axes: Axes, title: str, x: str, y: str) -> None:
    axes.set_title(title)
    axes.set_xlabel(x)
    axes.set_ylabel(y)


def main(
    task: Annotated[int, typer.Option(help="Number of the task.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Where a picture goes.")] = None,
    cache: Annotated[
        Path | None, typer.Option(help="Folder of compiled problems; else this machine's.")
    ] = None,
    record: Annotated[bool, typer.Option("--record", help="Keep for the docs.")] = False,
) -> None:
    """Solve, print the figures, draw."""
    try:
        found = residuals(solved(task, cache))
    except LmtrError as error:
        console.print(f"error: {error}", style="red", markup=False, soft_wrap=True)
        raise typer.Exit(1) from error
    for rule, residual in found.by_rule.items():
        error = found.velocity_error(rule)
        console.print(
            f"balance {rule}: peak {np.abs(residual).max():.2f} m/s², velocity error up to "
            f"{1e3 * np.abs(error).max():.1f} mm/s and {1e3 * error[-1]:.1f} mm/s at the end"
        )
    for image in filter(None, (out, PICTURE if record else None)):
        console.print(f"drawn to {save(picture(found), image)}", markup=False)


if __name__ == "__main__":
    typer.run(main)
