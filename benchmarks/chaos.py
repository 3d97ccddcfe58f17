"""Kill processes of a generation at random, again and again, and count what it costs.

    python -m benchmarks.chaos --kills 50 --solutions 3000 --seed 1

First a data set is made undisturbed. Then the same one is made in another home while workers, the
writer, the driver and Ray's raylet are killed (SIGKILL), in an order and at times that the seed
decides; a driver that ends is started again by the same command until the data set is complete.
Both must then be the same, row for row and bit for bit. Solves are synthetic unless ``--expert``.
"""

import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import psutil
import pyarrow as pa
import typer
from rich.console import Console
from rich.table import Table

from benchmarks.processes import Role, end_all, family, kill, left_over, playing
from pipelines.progress import Bar, bar
from services.home import Home
from services.lake.digest import digested_columns, row_digests
from services.lake.tables import Lake

WEIGHTS = {Role.WORKER: 5, Role.WRITER: 3, Role.DRIVER: 1, Role.RAYLET: 1}

RHYTHM = ("cluster.batch_seconds=0.5", "cluster.commit_items=50", "cluster.commit_seconds=1.0")
"""Many small commits, so that kills meet the writer at work."""

STUCK_S = 300.0
"""A driver that has not ended so long after its last kill is stuck."""

GONE_S = 100.0
"""After so long nothing of a driver may run any more; Ray's agents wait a minute for a raylet."""

console = Console()


@dataclass
class Toll:
    """What a run took.

    Attributes:
        kills: By role.
        starts: How often the driver was started.
        ends: Exit statuses of the driver.
        left: Processes that outlived their driver.
        seconds: Of the whole run.
    """

    kills: Counter[Role] = field(default_factory=Counter)
    starts: int = 0
    ends: Counter[int] = field(default_factory=Counter)
    left: list[str] = field(default_factory=list)
    seconds: float = 0.0


def main(
    kills: Annotated[int, typer.Option(min=0, help="Kills in a row.")] = 20,
    solutions: Annotated[int, typer.Option(min=10, help="Rows of the data set.")] = 2000,
    workers: Annotated[int, typer.Option(min=1)] = 2,
    delay: Annotated[float, typer.Option(help="Sleep of a synthetic solve (s).")] = 0.03,
    pause: Annotated[float, typer.Option(help="Mean time between two kills (s).")] = 2.0,
    seed: Annotated[int, typer.Option(help="Decides who is killed, and when.")] = 0,
    expert: Annotated[bool, typer.Option("--expert", help="Solve with the real expert.")] = False,
) -> None:
    """Run undisturbed and disturbed; exit status 1 if the two differ."""
    with tempfile.TemporaryDirectory(prefix="lmtr-chaos-") as folder:
        calm, wild = Path(folder) / "calm", Path(folder) / "wild"
        command = generation(solutions, workers, delay, expert=expert)
        rng = random.Random(seed)
        with bar("Undisturbed", None) as progress:
            undisturbed = run(command, calm, 0, pause, rng, progress)
        with bar("Kills", kills) as progress:
            disturbed = run(command, wild, kills, pause, rng, progress)
        same = report(undisturbed, disturbed, rows(calm), rows(wild))
    raise typer.Exit(0 if same else 1)


def generation(solutions: int, workers: int, delay: float, *, expert: bool) -> list[str]:
    """The command that generates, but for its home."""
    program = ["pipelines", "generate"] if expert else ["benchmarks.synthetic", f"--delay={delay}"]
    sets = [word for setting in RHYTHM for word in ("--set", setting)]
    size = ["--solutions", str(solutions), "--workers", str(workers)]
    return [sys.executable, "-m", *program, *size, *sets]


def run(
    command: list[str], home: Path, kills: int, pause: float, rng: random.Random, progress: Bar
) -> Toll:
    """Start the command again until it is done, while so many kills befall it."""
    toll, began = Toll(), time.monotonic()
    seen: dict[int, psutil.Process] = {}
    try:
        while toll.ends[0] == 0:
            toll.starts += 1
            toll.ends[once(command, home, kills, pause, rng, toll, seen, progress)] += 1
            if toll.starts > kills + 2:
                raise SystemExit(f"chaos: the driver ends without a kill: {dict(toll.ends)}")
        toll.seconds = time.monotonic() - began
        toll.left = left_over(seen.values(), GONE_S)
    finally:
        end_all(seen.values())
    return toll


def once(
    command: list[str],
    home: Path,
    kills: int,
    pause: float,
    rng: random.Random,
    toll: Toll,
    seen: dict[int, psutil.Process],
    progress: Bar,
) -> int:
    """Start the driver and wait for its end; returns its exit status."""
    with (home.parent / f"{home.name}.log").open("ab") as log:
        driver = subprocess.Popen(
            [*command, "--home", str(home)], stdout=log, stderr=log, start_new_session=True
        )
    last = time.monotonic()
    while driver.poll() is None:
        seen.update((process.pid, process) for process in family(driver.pid))
        if toll.kills.total() < kills:
            disturb(driver.pid, pause, rng, toll, progress)
            last = time.monotonic()
        elif time.monotonic() - last > STUCK_S:
            raise SystemExit(f"chaos: the driver goes on for {STUCK_S:.0f} s after the last kill")
        else:
            time.sleep(0.5)
    return driver.returncode


def disturb(driver: int, pause: float, rng: random.Random, toll: Toll, progress: Bar) -> None:
    """Wait a while, then kill one process of a role that is drawn by weight."""
    if not playing(Role.WORKER, driver):
        time.sleep(0.2)  # still starting
        return
    role = rng.choices(list(WEIGHTS), list(WEIGHTS.values()))[0]
    time.sleep(rng.expovariate(1.0 / pause))
    found = playing(role, driver)
    if found and kill(rng.choice(found)):
        toll.kills[role] += 1
        progress.advance(note=f"{role}; {toll.starts} starts")


def rows(home: Path) -> pa.Table:
    """Identity, numbers and digests of all rows, by index."""
    columns = [*digested_columns("solutions"), "digest"]
    lake = Lake(Home.open(home, create=False).lake)
    return lake.read("solutions", columns, order_by='"index"').combine_chunks()


def report(undisturbed: Toll, disturbed: Toll, calm: pa.Table, wild: pa.Table) -> bool:
    """Print what it cost; returns whether nothing was lost, doubled, changed or left running."""
    expected, made = set(calm["index"].to_pylist()), Counter(wild["index"].to_pylist())
    lost, doubled = len(expected - set(made)), sum(count - 1 for count in made.values())
    equal = row_digests("solutions", wild) == row_digests("solutions", calm)
    sealed = wild["digest"].to_pylist() == row_digests("solutions", wild)
    table = Table(title=f"{len(expected)} rows, {disturbed.kills.total()} kills")
    table.add_column("figure")
    table.add_column("value", justify="right")
    for role in WEIGHTS:
        table.add_row(f"kills of a {role}", str(disturbed.kills[role]))
    table.add_row("starts of the driver", str(disturbed.starts))
    ends = ", ".join(f"{count} × {status}" for status, count in sorted(disturbed.ends.items()))
    table.add_row("exit statuses of the driver", ends)
    table.add_row("processes that outlived it", str(len(disturbed.left)))
    table.add_row("rows lost", str(lost))
    table.add_row("rows doubled", str(doubled))
    table.add_row("equal to the undisturbed one, bit for bit", str(equal and sealed))
    table.add_row("time undisturbed (s)", f"{undisturbed.seconds:.1f}")
    table.add_row("time disturbed (s)", f"{disturbed.seconds:.1f}")
    table.add_row("ratio", f"{disturbed.seconds / undisturbed.seconds:.2f}")
    console.print(table)
    return not (lost or doubled or disturbed.left) and equal and sealed


if __name__ == "__main__":
    typer.run(main)
