"""Progress of long work, for a terminal or for a log."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

LOG_EVERY_S = 15.0
"""Seconds between two progress lines when the output is no terminal."""

console = Console(stderr=True, highlight=False)


class Bar:
    """One line of progress: a count out of a total, and a few words that change.

    Pieces that are under way side by side have a line each below it; a log names them in its line.
    """

    def __init__(self, progress: Progress, task: TaskID, title: str, total: int | None) -> None:
        self._progress = progress
        self._task = task
        self._title = title
        self._total = total
        self._done = 0
        self._logged = time.monotonic()
        self._pieces: dict[str, tuple[TaskID, str]] = {}

    def advance(self, steps: int = 1, note: str = "") -> None:
        """Count ``steps`` more as done; ``note`` replaces the words at the end of the line."""
        self._done += steps
        self._progress.update(self._task, advance=steps, note=note)
        if not console.is_terminal and time.monotonic() - self._logged > LOG_EVERY_S:
            self._logged = time.monotonic()
            pieces = "".join(f"{said}; " for _, said in self._pieces.values())
            say(f"{self._title}: {self._done}/{self._total or '?'} {pieces}{note}")

    def piece(self, name: str, done: int, total: int, note: str = "") -> None:
        """Say how far a piece is; it gets its line when it is first heard of."""
        if name in self._pieces:
            task, _ = self._pieces[name]
        else:
            task = self._progress.add_task(f"  {name}", total=total, note="")
        self._progress.update(task, completed=done, note=note)
        self._pieces[name] = task, " ".join(filter(None, (name, f"{done}/{total}", note)))

    def drop(self, name: str) -> None:
        """Take the line of a piece away, if it has one."""
        if name in self._pieces:
            task, _ = self._pieces.pop(name)
            self._progress.remove_task(task)


@contextmanager
def bar(title: str, total: int | None) -> Iterator[Bar]:
    """Show progress while the block runs; a total of None is not known beforehand."""
    progress = Progress(
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
        console=console,
        disable=not console.is_terminal,
    )
    with progress:
        yield Bar(progress, progress.add_task(title, total=total, note=""), title, total)


def say(message: str) -> None:
    """Print one line of news about the work, on standard error."""
    console.print(message, markup=False, soft_wrap=True)
