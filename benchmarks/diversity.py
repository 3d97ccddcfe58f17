"""How many distinct solutions a task has, how they differ, and what they cost.

    python benchmarks/diversity.py --tasks 20 --draws 30 --out build/diversity --record
    python benchmarks/diversity.py --redraw --record --out build/diversity  # of the same solves

Solves fixed tasks from many initial guesses each, gathers the accepted solutions of a task into
modes by footholds and contact times, and says how often feet change their order. Some guesses are
solved once more, to the optimum and from nearby, which tells whether modes are the problem's own.
``--record`` keeps pictures and figures for the docs (``docs/modes.md``). One process.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from benchmarks.solving.circumstances import (
    JUDGEMENT,
    Circumstances,
    circumstances,
    require_same,
    sections,
    verdict_by,
)
from benchmarks.solving.ready import ready_expert
from benchmarks.solving.record import plain
from benchmarks.variety.picture import gallery, overview
from benchmarks.variety.solves import (
    TASK_SEED,
    Study,
    Walk,
    judged,
    read,
    solve_all,
    strict,
    write,
)
from benchmarks.variety.summary import TaskModes, summarise, task_modes
from lmtr.errors import DataError, LmtrError
from lmtr.figures.style import save
from pipelines.config import Configuration, load

ROOT = Path(__file__).resolve().parent.parent
IMAGES = ROOT / "docs" / "images"
RECORD = ROOT / "benchmarks" / "results" / "diversity.json"

console = Console()


def main(
    out: Annotated[Path, typer.Option(help="Folder for solves, pictures and summary.")],
    tasks: Annotated[int, typer.Option(min=1, help="Tasks.")] = 20,
    draws: Annotated[int, typer.Option(min=2, help="Guesses of each.")] = 30,
    settings: Annotated[str | None, typer.Option(help="Configuration of a run, TOML.")] = None,
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Override a setting; may be repeated."),
    ] = None,
    cache: Annotated[
        Path | None, typer.Option(help="Folder of compiled problems; else this machine's.")
    ] = None,
    redraw: Annotated[bool, typer.Option("--redraw", help="Use the solves kept there.")] = False,
    record: Annotated[bool, typer.Option("--record", help="Keep for the docs.")] = False,
) -> None:
    """Solve, or read solves; print what they come to; draw."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        config = load(settings, overrides or [])
        file = out / "solves.json"
        if not redraw:
            solve(config, tasks, draws, cache, file)
        made, walks = read(file)
        if record:
            require_same(made, present(config, made.tasks, made.compiled), "diversity", "--record")
        walks = judged(walks, config.dataset.robot, config.expert, config.quality)
        report(made, verdict_by(config.quality), walks, out, record)
    except LmtrError as error:
        console.print(f"error: {error}", style="red", markup=False, soft_wrap=True)
        raise typer.Exit(1) from error


def solve(config: Configuration, tasks: int, draws: int, cache: Path | None, file: Path) -> None:
    """Solve, and keep the solves with what made them."""
    robot, settings = config.dataset.robot, config.expert
    study = Study(robot, config.tasks, settings, tasks, draws)
    usual = ready_expert(robot, settings, cache, console)
    exact = ready_expert(robot, strict(settings), cache, console)
    made = present(config, tasks, usual.compiled and exact.compiled)
    write(file, made, solve_all(study, usual, exact))


def present(config: Configuration, tasks: int, compiled: bool) -> Circumstances:
    """The present code and settings, but for the filter, which judges kept solves anew."""
    settings = {name: each for name, each in sections(config).items() if name != "quality"}
    return circumstances(settings, TASK_SEED, tasks, compiled=compiled, without=JUDGEMENT)


def report(
    made: Circumstances, verdict: dict[str, str], walks: Sequence[Walk], out: Path, record: bool
) -> None:
    """Print, draw and write what the walks say.

    Raises:
        DataError: No solution was accepted.
    """
    found = task_modes(walks)
    if not found:
        raise DataError("diversity: the filter accepted no solution; look at its reasons first")
    summary = summarise(walks, found)
    console.print(tasks_table(found))
    console.print_json(json.dumps(plain({k: v for k, v in summary.items() if k != "tasks"})))
    text = as_json({"circumstances": asdict(made), "verdict": verdict, **rounded(summary)})
    targets = [(out, out / "diversity.json"), *([(IMAGES, RECORD)] if record else [])]
    for images, numbers in targets:
        numbers.parent.mkdir(parents=True, exist_ok=True)
        numbers.write_text(text, encoding="utf-8")
        for name, picture in (("modes", gallery(found)), ("modes_costs", overview(found))):
            save(picture, images / f"{name}.png")
        console.print(f"wrote {numbers} and pictures in {images}", markup=False)


def tasks_table(tasks: Sequence[TaskModes]) -> Table:
    """Modes of each task: how many, how large, what they cost."""
    table = Table(title="Modes by task, cheapest first", title_justify="left")
    for name in ("task", "accepted", "modes", "sizes", "best cost", "best of the others, %"):
        table.add_column(name, justify="right")
    for task in tasks:
        best = task.costs[task.best]
        table.add_row(
            str(task.index),
            f"{len(task.walks)}/{task.solved}",
            str(task.count),
            " ".join(str(len(task.members(mode))) for mode in task.modes),
            f"{best[0]:.3f}",
            " ".join(f"{100.0 * (cost / best[0] - 1.0):.1f}" for cost in best[1:6]),
        )
    return table


def as_json(summary: dict[str, Any]) -> str:
    """A summary with one task on a line, for their modes would fill thousands."""
    head = json.dumps(plain({k: v for k, v in summary.items() if k != "tasks"}), indent=1)
    tasks = ",\n  ".join(json.dumps(plain(task)) for task in summary["tasks"])
    return f'{head.removesuffix("}").rstrip()},\n "tasks": [\n  {tasks}\n ]\n}}\n'


def rounded(value: Any) -> Any:  # noqa: ANN401 - whatever a summary holds
    """The same with numbers to four digits, which is what they are good for."""
    if isinstance(value, dict):
        return {key: rounded(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [rounded(entry) for entry in value]
    return float(f"{value:.4g}") if isinstance(value, float) else value


if __name__ == "__main__":
    typer.run(main)
