"""Watch the driver's memory while it generates many rows that cost nothing to solve.

    python -m benchmarks.memory --solutions 100000

What a driver keeps for each row would show as a slope. Resident memory is sampled from the first
row on; the slope is that of a straight line through the samples of the second half.
"""

import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import psutil
import typer
from rich.console import Console
from rich.table import Table

from benchmarks.processes import Role, playing
from pipelines.progress import bar
from services.home import Home
from services.lake.tables import Lake

GOAL_MB = 600.0
"""The driver's memory stays below this (MB)."""

SAMPLE_S = 1.0

console = Console()


@dataclass(frozen=True)
class Sample:
    """Memory at one time.

    Attributes:
        seconds: Since the start (s).
        driver_mb: Resident memory of the driver (MB).
        writer_mb: Of the writer; 0 while there is none.
    """

    seconds: float
    driver_mb: float
    writer_mb: float


def main(
    solutions: Annotated[int, typer.Option(min=100, help="Rows to generate.")] = 100_000,
    workers: Annotated[int, typer.Option(min=1)] = 2,
    home: Annotated[Path | None, typer.Option(help="Keep the home here.")] = None,
    overrides: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Override a setting.")
    ] = None,
) -> None:
    """Generate and print the driver's memory; exit status 1 above the goal."""
    with tempfile.TemporaryDirectory(prefix="lmtr-memory-") as folder:
        root = home or Path(folder) / "home"
        samples, status, said = watch(root, solutions, workers, overrides or ())
        if status:
            console.print(said, markup=False)
            raise typer.Exit(status)
        lake = Lake(Home.open(root, create=False).lake)
        count = lake.query_value("SELECT count(*) FROM solutions")
    peak = report(samples, int(str(count)))
    raise typer.Exit(0 if peak <= GOAL_MB else 1)


def watch(
    home: Path, solutions: int, workers: int, overrides: Sequence[str]
) -> tuple[list[Sample], int, str]:
    """Generate; returns samples of the memory, exit status and what was said."""
    command = [sys.executable, "-m", "benchmarks.synthetic", "--home", str(home)]
    command += ["--solutions", str(solutions), "--workers", str(workers)]
    command += [word for setting in overrides for word in ("--set", setting)]
    samples, began = [], time.monotonic()
    with tempfile.TemporaryFile("w+") as log, bar("Sampling memory", None) as progress:
        driver = subprocess.Popen(command, stdout=log, stderr=log)
        while driver.poll() is None:
            if playing(Role.WORKER, driver.pid):
                samples.append(sample(driver.pid, time.monotonic() - began))
                progress.advance(note=f"driver {samples[-1].driver_mb:.0f} MB")
            time.sleep(SAMPLE_S)
        log.seek(0)
        return samples, driver.returncode, log.read()


def sample(driver: int, seconds: float) -> Sample:
    """Memory of the driver and its writer now."""

    def resident(role: Role) -> float:
        total = 0.0
        for process in playing(role, driver):
            try:
                total += process.memory_info().rss / 1e6
            except psutil.NoSuchProcess:
                continue
        return total

    return Sample(seconds, resident(Role.DRIVER), resident(Role.WRITER))


def report(samples: list[Sample], count: int) -> float:
    """Print the figures; returns the driver's largest (MB)."""
    seconds = np.array([s.seconds for s in samples])
    driver = np.array([s.driver_mb for s in samples])
    half = len(samples) // 2
    slope = float(np.polyfit(seconds[half:], driver[half:], 1)[0])
    rate = count / float(seconds[-1] - seconds[0])
    table = Table(title=f"{count} rows, {rate:.0f} rows/s with starts and stops")
    table.add_column("driver's resident memory")
    table.add_column("value", justify="right")
    table.add_row("at the start (MB)", f"{driver[0]:.0f}")
    table.add_row("median (MB)", f"{np.median(driver):.0f}")
    table.add_row("largest (MB)", f"{driver.max():.0f}")
    table.add_row("goal (MB)", f"{GOAL_MB:.0f}")
    table.add_row("slope of the second half (MB per 10,000 rows)", f"{slope / rate * 1e4:.2f}")
    table.add_row("the writer's largest (MB)", f"{max(s.writer_mb for s in samples):.0f}")
    console.print(table)
    return float(driver.max())


if __name__ == "__main__":
    typer.run(main)
