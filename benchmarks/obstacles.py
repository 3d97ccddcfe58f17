"""How near to obstacle lines the expert's feet come down, and what its range of motion costs.

    python benchmarks/obstacles.py --tasks 60 --out build/obstacles --record
    python benchmarks/obstacles.py --redraw --record --out build/obstacles  # of the same solves

Solves the same tasks with and without the lines' potential, with up to four lines and with one
right beside the start; and with forward ranges of motion from 0.14 to 0.2 m, for goals as far as
they reach. Prints tables, draws two pictures; ``--record`` keeps these and the figures for the
docs. One process; solves are kept group by group, and ``--resume`` goes on with them.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from benchmarks.footholds.families import Group, groups
from benchmarks.footholds.picture import box_picture, foothold_picture
from benchmarks.footholds.solves import SEED, Walk, judged, read, solve_groups, write
from benchmarks.footholds.summary import summarise
from benchmarks.footholds.tables import tables
from benchmarks.solving.circumstances import (
    JUDGEMENT,
    Circumstances,
    circumstances,
    require_same,
    verdict_by,
)
from benchmarks.solving.ready import ready_expert
from benchmarks.solving.record import plain
from lmtr.errors import DataError, LmtrError
from lmtr.expert.settings import ExpertSettings
from lmtr.figures.style import save
from lmtr.quality.filter import QualityThresholds
from lmtr.robot.model import ANYMAL

ROOT = Path(__file__).resolve().parent.parent
IMAGES = ROOT / "docs" / "images"
RECORD = ROOT / "benchmarks" / "results" / "obstacles.json"

console = Console()
if not console.is_terminal:
    console = Console(width=200)  # in a file or a pipe nothing needs to be cut


def main(
    out: Annotated[Path, typer.Option(help="Folder for solves, pictures and summary.")],
    tasks: Annotated[int, typer.Option(min=10, help="Tasks of each group.")] = 60,
    cache: Annotated[
        Path | None, typer.Option(help="Folder of compiled problems; else this machine's.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Solve what is missing.")] = False,
    redraw: Annotated[bool, typer.Option("--redraw", help="Solve nothing.")] = False,
    record: Annotated[bool, typer.Option("--record", help="Keep for the docs.")] = False,
) -> None:
    """Solve, or read solves; print tables; draw."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        file, now = out / "solves.json", present(tasks)
        if not redraw:
            solve(file, now, cache, resume)
        made, walks = read(file, list(groups()))
        require_all(walks, list(groups()))
        if record:
            require_same(made, now, "obstacles", "--record")
        report(made, judged(walks, groups()), out, record)
    except LmtrError as error:
        console.print(f"error: {error}", style="red", markup=False, soft_wrap=True)
        raise typer.Exit(1) from error


def present(tasks: int) -> Circumstances:
    """The present code and settings, but for the filter, which judges kept solves anew."""
    settings = {"robot": ANYMAL, "expert": ExpertSettings()}  # distributions belong to groups
    return circumstances(settings, SEED, tasks, compiled=True, without=JUDGEMENT)


def solve(file: Path, now: Circumstances, cache: Path | None, resume: bool) -> None:
    """Solve all groups, or those that the file lacks, and keep the walks in it."""
    compared = list(groups())
    kept: list[Walk] = []
    if resume and file.is_file():
        made, kept = read(file, compared)
        require_same(made, now, "obstacles", "--resume")

    def save(walks: Sequence[Walk]) -> None:
        compiled = all(walk.compiled for walk in walks)
        write(file, replace(now, compiled=compiled), compared, walks)

    solve_groups(
        compared,
        now.tasks,
        lambda robot, settings: ready_expert(robot, settings, cache, console),
        kept,
        save,
    )


def require_all(walks: Sequence[Walk], compared: Sequence[Group]) -> None:
    """Refuse to draw what has not been solved.

    Raises:
        DataError: A group has no walks.
    """
    solved = {walk.group for walk in walks}
    missing = [group.name for group in compared if group.name not in solved]
    if missing:
        raise DataError(
            f"obstacles: {', '.join(missing)} have no solves with the present settings; solve "
            "them with --resume"
        )


def report(made: Circumstances, walks: Sequence[Walk], out: Path, record: bool) -> None:
    """Print, draw and write what the walks say."""
    summary = summarise(walks)
    for table in tables(summary):
        console.print(table)
    pictures = {
        "footholds": foothold_picture(walks, summary),
        "range_of_motion": box_picture(summary),
    }
    told = {"circumstances": asdict(made), "verdict": verdict_by(QualityThresholds())}
    text = json.dumps(plain(told | summary), indent=1)
    for images, file in [(out, out / "obstacles.json"), *([(IMAGES, RECORD)] if record else [])]:
        file.write_text(text + "\n", encoding="utf-8")
        for name, picture in pictures.items():
            console.print(f"wrote {save(picture, images / f'{name}.png')}", markup=False)
        console.print(f"wrote {file}", markup=False)


if __name__ == "__main__":
    typer.run(main)
