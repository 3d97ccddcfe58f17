"""Measure training: one LMTR to its plateau, and what a second worker brings to a sweep.

    python benchmarks/training.py --home HOME --models 6

HOME holds a cut data set; its segments are copied into homes of their own. Sweeps of one worker and
of two take turns on the same models. Rates are between the first models that are done and the last,
so that starting Ray does not count. The plateau is where the validation loss has come within one
hundredth of its least.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from lmtr.models import checkpoint
from services.home import Home
from services.lake.tables import Lake
from services.models import ModelStore

PLATEAU = 1.01
"""Validation loss over its least, from which on it counts as flat."""

NEEDED = ("datasets", "solutions", "cuts", "segments")
"""Tables that training reads."""


def main(
    home: Annotated[Path, typer.Option(help="Home with a cut data set.")],
    dataset: Annotated[str | None, typer.Option(help="Data set; the newest by default.")] = None,
    models: Annotated[int, typer.Option(min=4, help="Models of a sweep.")] = 6,
    latent: Annotated[int, typer.Option(min=1, help="Latent dimensions of each.")] = 6,
    epochs: Annotated[int, typer.Option(min=2, help="Epochs of each.")] = 20,
    rounds: Annotated[int, typer.Option(min=1, help="Sweeps with each number of workers.")] = 2,
) -> None:
    """Train in turns and print what came out."""
    console = Console()
    chosen = [] if dataset is None else ["--dataset", dataset]
    rates: dict[int, list[float]] = {1: [], 2: []}
    for turn in range(rounds):
        for workers in (1, 2) if turn % 2 == 0 else (2, 1):
            rate, _ = _sweep(home, [*chosen, *_settings(latent, models, epochs)], workers)
            rates[workers].append(rate)
            console.print(f"{workers} workers: {60.0 * rate:.2f} models a minute")
    one, two = (float(np.median(rates[workers])) for workers in (1, 2))
    table = Table("workers", "models/min", "against one", title="Sweep")
    table.add_row("1", f"{60.0 * one:.2f}", "1")
    table.add_row("2", f"{60.0 * two:.2f}", f"{two / one:.2f}")
    console.print(table)
    rate, losses = _sweep(home, [*chosen, *_settings(latent, 4, 80)], 1)
    shares = [epoch / 80 for epoch in map(_plateau, losses)]
    console.print(
        f"LMTR-{latent}, 80 epochs, one core: {1.0 / rate:.0f} s a model with all its evaluation; "
        f"within one hundredth of its least loss after {np.median(shares):.0%} of it"
    )


def _settings(latent: int, models: int, epochs: int) -> list[str]:
    """Settings of a sweep of the paper's amount of data."""
    return [
        f"--set=training.latent=[{latent}]",
        f"--set=training.seeds={list(range(100, 100 + models))}",
        f"--set=training.optimizer.epochs={epochs}",
    ]


def _sweep(home: Path, options: list[str], workers: int) -> tuple[float, list[dict[int, float]]]:
    """Train in a home of its own.

    Returns:
        Models per second between the first that were done and the last; validation losses of each
        model by epoch.
    """
    with tempfile.TemporaryDirectory() as scratch:
        own = Path(scratch, "home")
        (own / "lake").mkdir(parents=True)
        shutil.copy(home / "home.json", own)
        for table in NEEDED:
            shutil.copytree(home / "lake" / table, own / "lake" / table)
        command = [sys.executable, "-m", "pipelines", "--home", str(own), "train", "-c", "paper"]
        subprocess.run(
            [*command, *options, "--workers", str(workers)],
            check=True,
            stdout=subprocess.DEVNULL,
        )
        opened = Home.open(own, create=False)
        rows = Lake(opened.lake).read("models", ["model_id", "created_at"])
        made = np.sort(rows["created_at"].to_numpy())
        seconds = (made[-1] - made[workers - 1]) / np.timedelta64(1, "s")
        folders = [ModelStore(opened).folder(name) for name in rows["model_id"].to_pylist()]
        return float((len(made) - workers) / seconds), [_losses(folder) for folder in folders]


def _losses(folder: Path) -> dict[int, float]:
    """Validation losses of a trained model by epoch."""
    history = checkpoint.load(folder).history
    return {each.epoch: each.validation.loss for each in history if each.validation}


def _plateau(losses: dict[int, float]) -> int:
    """The first epoch at which the loss is near its least; annealing brings it down to the end."""
    least = min(losses.values())
    return min(epoch for epoch, loss in losses.items() if loss <= PLATEAU * least)


if __name__ == "__main__":
    typer.run(main)
