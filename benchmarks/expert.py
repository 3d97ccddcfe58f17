"""Measure the expert: processor time, convergence, acceptance, and what its solutions violate.

    python benchmarks/expert.py --tasks 200 --out expert.json
    python benchmarks/expert.py --against ../previous            # its time over another checkout's
    python benchmarks/expert.py --against-set expert.obstacle_weight=0
    python benchmarks/expert.py --against-set 'dataset.robot.range_of_motion=[0.2, 0.12, 0.1]'

Tasks and noise are those of a data set with the same configuration and seed. Every figure stands
beside its goal and its ratio to the last recorded result. Times of two runs differ by what else the
machine does, so another checkout, or this one with other settings, can be measured in the same run:
both experts take turns, task by task. Settings are named as in the configuration of a run.
"""

import json
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from benchmarks.solving.circumstances import circumstances, differences, sections
from benchmarks.solving.figures import PEER, Summary, summarise
from benchmarks.solving.lanes import HERE, Contender, open_lanes, solve_all
from benchmarks.solving.pairs import PairedRatio, compare
from benchmarks.solving.record import Result, plain, read_record, write_record
from benchmarks.solving.rows import Row, count_reasons, draw_tasks, solve_row
from benchmarks.solving.tables import figures_table, outcomes, pairs_table, reasons_table
from benchmarks.solving.worker import Reply, configuration
from lmtr.errors import LmtrError
from lmtr.robot.model import ROBOTS
from pipelines.config import Configuration
from pipelines.progress import bar

console = Console()
if not console.is_terminal:
    console = Console(width=120)  # in a file or a pipe nothing needs to be cut


@dataclass(frozen=True)
class Measured:
    """An expert's rows and summary.

    Attributes:
        config: Its settings, as this checkout reads them.
        setup: What its worker told of the set-up.
        rows: One for each task.
        summary: Its figures.
    """

    config: Configuration
    setup: Reply
    rows: list[Row]
    summary: Summary


def main(
    tasks: Annotated[int, typer.Option(min=1, help="Tasks to solve.")] = 200,
    seed: Annotated[int | None, typer.Option(help="Seed of tasks; else the settings'.")] = None,
    robot: Annotated[str | None, typer.Option(help=f"One of {', '.join(ROBOTS)}.")] = None,
    settings: Annotated[str | None, typer.Option(help="Configuration of a run, TOML.")] = None,
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Override a setting; may be repeated."),
    ] = None,
    cache: Annotated[
        Path | None, typer.Option(help="Folder of compiled problems; else a fresh one.")
    ] = None,
    processes: Annotated[int, typer.Option(min=1, help="Solves at a time.")] = 1,
    against: Annotated[
        Path | None, typer.Option(help="Another checkout, measured in turns with this one.")
    ] = None,
    against_overrides: Annotated[
        list[str] | None,
        typer.Option("--against-set", metavar="KEY=VALUE", help="Override one of the other only."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="JSON file with every solve.")] = None,
    record: Annotated[bool, typer.Option("--record", help="Keep as the recorded result.")] = False,
) -> None:
    """Solve tasks; print every figure beside its goal and its ratio to the recorded result."""
    named = (*([f"dataset.robot={robot}"] if robot else []), *(overrides or []))
    contenders = [Contender(HERE, settings, named)]
    if against is not None or against_overrides:
        differing = (*named, *(against_overrides or []))
        contenders.append(Contender(against or HERE, settings, differing))
    try:
        config = configuration(settings, named)
        seed = config.dataset.seed if seed is None else seed
        recorded = read_record(config.dataset.robot.name)  # before the work, lest that be lost
        experts = measure_experts(contenders, tasks, seed, cache, processes)
        now = report(experts, seed, recorded)
    except LmtrError as error:
        console.print(f"error: {error}", style="red", markup=False, soft_wrap=True)
        raise typer.Exit(1) from error
    if out is not None:
        write_rows(out, now, experts)
    if record:
        write_record(config.dataset.robot.name, now)


def measure_experts(
    contenders: Sequence[Contender], count: int, seed: int, cache: Path | None, processes: int
) -> list[Measured]:
    """Let all contenders solve the same tasks, those of the first one's distribution."""
    configs = [configuration(c.source, c.overrides) for c in contenders]
    tasks = draw_tasks(configs[0], seed, count)
    with ExitStack() as stack:
        folder = cache or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        lanes = stack.enter_context(open_lanes(contenders, processes, folder))
        setups = [worker.setup for worker in lanes[0]]
        progress = stack.enter_context(bar("Solving tasks", count))
        replies = solve_all(lanes, tasks, progress.advance)
    experts = []
    for config, setup, answers in zip(configs, setups, zip(*replies, strict=True), strict=True):
        rows = [
            solve_row(index, task, reply, config, setup["cost_key"])
            for index, ((task, _), reply) in enumerate(zip(tasks, answers, strict=True))
        ]
        fresh = setup["compiled"] and not setup["cached"]
        summary = summarise(rows, setup["setup_s"] if fresh else np.nan)
        experts.append(Measured(config, setup, rows, summary))
    return experts


def report(experts: Sequence[Measured], seed: int, recorded: Result | None) -> Result:
    """Print the tables; returns this expert's result."""
    ours, *others = experts
    count, compiled = len(ours.rows), ours.setup["compiled"]
    made = circumstances(sections(ours.config), seed, count, compiled=compiled)
    now = Result(made, ours.summary)
    title = f"{ours.config.dataset.robot.name}, {count} tasks of seed {seed}"
    beside = others[0].summary if others else None
    console.print(figures_table(f"{title}, {now.circumstances.code}", now, beside, recorded))
    if others:
        console.print(pairs_table(paired(ours, others[0], seed)))
    if reasons := count_reasons(ours.rows):
        console.print(reasons_table(reasons, count))
    for note in notes(experts, now, recorded):
        console.print(note, soft_wrap=True, markup=False, highlight=False)
    return now


def paired(ours: Measured, other: Measured, seed: int) -> dict[str, PairedRatio]:
    """This expert over the other, task by task."""
    same_costs = ours.setup["cost_key"] == other.setup["cost_key"]
    return compare(ours.rows, other.rows, seed, same_costs=same_costs)


def write_rows(out: Path, now: Result, experts: Sequence[Measured]) -> None:
    """Everything that was measured, as JSON."""
    ours, *others = experts
    seed = now.circumstances.seed
    content = {
        **asdict(now),
        "rows": ours.rows,
        "others": [
            {
                "summary": other.summary,
                "ratios": {key: asdict(r) for key, r in paired(ours, other, seed).items()},
                "rows": other.rows,
            }
            for other in others
        ],
    }
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(plain(content), indent=1) + "\n", encoding="utf-8")


def notes(experts: Sequence[Measured], now: Result, recorded: Result | None) -> list[str]:
    """What a reader must know to read the tables right."""
    said = []
    for name, expert in zip(("this expert", "the other expert"), experts, strict=False):
        said.append(f"{name}: {outcomes([row['status'] for row in expert.rows])}")
        if not expert.setup["compiled"]:
            said.append(f"{name} ran without some of its machine code: {expert.setup['reason']}")
        if unmeasured := [row["unmeasured"] for row in expert.rows if "unmeasured" in row]:
            said.append(f"{name}: {len(unmeasured)} solves could not be measured: {unmeasured[0]}")
        if not any(row.get("expected_cost") for row in expert.rows):
            said.append(f"{name}: no cost is expected with these settings, so none was judged")
    if recorded is None:
        said.append("No result is recorded yet; --record keeps this one.")
    else:
        kept = recorded.circumstances
        said.append(f"The record is of {kept.code}, {kept.day}.")
        said += [f"  {text}" for text in differences(now.circumstances, kept)]
    return [*said, PEER]


if __name__ == "__main__":
    typer.run(main)
