"""``lmtr generate`` with a solver that waits for a sign, so that two drivers begin at once.

    python -m tests.faults.gated --home HOME --gate FOLDER --name NAME --solutions 100 --workers 1

A worker that is ready leaves a file ``NAME.ready`` at the gate, and solves once ``open`` lies
there. The table's history gets the name in the place of the code's version.
"""

import functools
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.synthetic import SyntheticExpert, synthetic_configuration
from lmtr.expert.solve import Solution
from lmtr.task.sampling import Noise
from lmtr.task.task import Task
from pipelines import generation_tally
from pipelines.config import Configuration
from pipelines.generate import generate
from pipelines.workspace import Workspace

OPEN = "open"

DELAY_S = 0.05
"""Sleep that a solve takes: some commits' worth of solves for each driver."""

RHYTHM = ("cluster.batch_seconds=0.2", "cluster.commit_items=4", "cluster.commit_seconds=0.5")


@dataclass(frozen=True)
class GatedExpert(SyntheticExpert):
    """Solves nothing until the gate is open.

    Attributes:
        gate: Folder of the signs.
        name: Whose worker it is.
    """

    gate: Path = Path()
    name: str = ""

    def solve(self, task: Task, noise: Noise) -> Solution:
        """Say that all is ready, wait, and make up a solution."""
        (self.gate / f"{self.name}.ready").touch()
        while not (self.gate / OPEN).exists():
            time.sleep(0.02)
        return super().solve(task, noise)


def make_gated(config: Configuration, gate: Path, name: str) -> GatedExpert:
    """The solver of a configuration."""
    return GatedExpert(config.dataset.robot, config.expert, DELAY_S, gate, name)


def main(
    home: Annotated[Path, typer.Option()],
    gate: Annotated[Path, typer.Option()],
    name: Annotated[str, typer.Option()],
    solutions: Annotated[int, typer.Option()],
    workers: Annotated[int, typer.Option()],
) -> None:
    """Generate."""
    generation_tally.code_version = lambda: name
    settings = synthetic_configuration(None, RHYTHM, solutions, workers)
    space = Workspace.open(home, settings.cluster, create=True)
    generate(settings, space, functools.partial(make_gated, gate=gate, name=name))


if __name__ == "__main__":
    # Workers must find this module by its name, not as the script that was started.
    from tests.faults import gated

    sys.exit(typer.run(gated.main))
