"""Measure the generation service: what a second worker brings, and what is spent beside solving.

    python benchmarks/generation.py --tasks 240 --rounds 2

Runs of the command line with one worker and with two take turns on the same tasks, each in a home
of its own. Rates are between the first row and the last, so that starting Ray does not count.
Processor time is that of the driver and all processes below it, sampled; what starting costs is
told apart by runs of a quarter of the tasks.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import psutil
import typer
from rich.console import Console
from rich.table import Table

from services.home import Home
from services.lake.tables import Lake

SAMPLE_S = 0.25
"""Time between two looks at the processes (s)."""

ROLES = ("ray::BatchSeat", "ray::Writer", "raylet", "gcs_server")
"""Processes that are told apart, by a part of their command line; the rest is 'other'."""


@dataclass(frozen=True)
class Measured:
    """One run.

    Attributes:
        rows: Solutions.
        accepted_rate: Accepted solutions per second between the first row and the last.
        cpu: Processor time by role (s).
        solve_cpu: Processor time of the solves (s).
    """

    rows: int
    accepted_rate: float
    cpu: dict[str, float]
    solve_cpu: float


def main(
    tasks: Annotated[int, typer.Option(min=8, help="Tasks of a run.")] = 240,
    rounds: Annotated[int, typer.Option(min=1, help="Runs with each number of workers.")] = 2,
    workers: Annotated[int, typer.Option(min=2, help="Compared with one.")] = 2,
) -> None:
    """Run in turns and print what came out."""
    console = Console()
    runs: dict[tuple[int, int], list[Measured]] = {}
    for turn in range(rounds):
        plan = [(1, tasks), (workers, tasks), (workers, tasks // 4)]
        for crew, count in plan if turn % 2 == 0 else plan[::-1]:
            runs.setdefault((crew, count), []).append(_run(crew, count))
            console.print(f"{crew} workers, {count} tasks: {_words(runs[crew, count][-1])}")
    console.print(_rates(runs[1, tasks], runs[workers, tasks], workers))
    console.print(_shares(runs[workers, tasks], runs[workers, tasks // 4]))


def _words(run: Measured) -> str:
    return f"{run.accepted_rate:.2f} accepted/s, {run.solve_cpu / run.rows:.3f} CPU s a solve"


def _run(workers: int, tasks: int) -> Measured:
    """Generate into a new home."""
    folder = Path(tempfile.mkdtemp())
    command = [sys.executable, "-m", "pipelines", "--home", str(folder / "home"), "generate"]
    options = ["-n", str(tasks), "-w", str(workers)]
    try:
        driver = subprocess.Popen(
            [*command, *options], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        cpu = _watch(driver)
        if driver.returncode:
            raise typer.Exit(driver.returncode)
        return _measured(folder / "home", cpu)
    finally:
        shutil.rmtree(folder)


def _watch(driver: "subprocess.Popen[bytes]") -> dict[str, float]:
    """Processor time of the driver and all below it by role, while it runs (s)."""
    spent: dict[int, tuple[str, float]] = {}
    while driver.poll() is None:
        for pid, role, seconds in _looks(driver.pid):
            known = spent.get(pid, (role, 0.0))
            spent[pid] = (role if role != "other" else known[0], max(seconds, known[1]))
        time.sleep(SAMPLE_S)
    cpu: dict[str, float] = {}
    for role, seconds in spent.values():
        cpu[role] = cpu.get(role, 0.0) + seconds
    return cpu


def _looks(pid: int) -> Iterator[tuple[int, str, float]]:
    try:
        processes = [psutil.Process(pid), *psutil.Process(pid).children(recursive=True)]
    except psutil.NoSuchProcess:
        return
    for process in processes:
        try:
            line = " ".join(process.cmdline())
            times = process.cpu_times()
        except psutil.Error:
            continue
        named = next((role for role in ROLES if role in line), "other")
        role = "driver" if process.pid == pid else named
        yield process.pid, role, times.user + times.system


def _measured(home: Path, cpu: dict[str, float]) -> Measured:
    lake = Lake(Home.open(home, create=False).lake)
    rows = lake.read("solutions", ["accepted", "created_at", "solve_cpu_s"])
    made = np.sort(rows["created_at"].to_numpy())
    seconds = (made[-1] - made[0]) / np.timedelta64(1, "s")
    accepted = np.asarray(rows["accepted"].to_pylist()).mean()
    solve_cpu = float(np.sum(rows["solve_cpu_s"].to_numpy()))
    rate = accepted * (len(made) - 1) / seconds
    return Measured(len(made), float(rate), cpu, solve_cpu)


def _rates(one: list[Measured], many: list[Measured], workers: int) -> Table:
    table = Table("workers", "accepted/s", "against one", title="Throughput")
    alone = float(np.median([run.accepted_rate for run in one]))
    together = float(np.median([run.accepted_rate for run in many]))
    table.add_row("1", f"{alone:.2f}", "1")
    table.add_row(str(workers), f"{together:.2f}", f"{together / alone:.2f}")
    return table


def _shares(long: list[Measured], short: list[Measured]) -> Table:
    """Where processor time goes: of a whole run, and of its steady part alone."""
    table = Table("processor time", "whole run (s)", "share", "steady (s)", "share")
    whole, begin = _total(long), _total(short)
    steady = {role: whole[role] - begin.get(role, 0.0) for role in whole}
    sums = sum(whole.values()), sum(steady.values())
    for role in sorted(whole, key=lambda role: -whole[role]):
        table.add_row(
            role,
            f"{whole[role]:.1f}",
            f"{whole[role] / sums[0]:.1%}",
            f"{steady[role]:.1f}",
            f"{steady[role] / sums[1]:.1%}",
        )
    return table


def _total(runs: list[Measured]) -> dict[str, float]:
    """Processor time of all runs by role; that of the workers in solves and the rest."""
    total: dict[str, float] = {"solves": sum(run.solve_cpu for run in runs)}
    for run in runs:
        for role, seconds in run.cpu.items():
            total[role] = total.get(role, 0.0) + seconds
    total["workers, beside solves"] = total.pop(ROLES[0], 0.0) - total["solves"]
    return total


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    typer.run(main)
