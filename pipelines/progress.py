"""Progress of long work, for a terminal or for a log, and read back from one."""

import math
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import ClassVar

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

from pipelines.terminal import printable

LOG_EVERY_S = 15.0
"""Seconds between two progress lines when the output is no terminal."""

console = Console(stderr=True, highlight=False)


@dataclass(frozen=True)
class Progressed:
    """A line of progress in a log.

    Attributes:
        title: What is being done.
        done: How much of it is.
        total: How much there is; None if that is not known.
        words: The rest, for people.
    """

    title: str
    done: int
    total: int | None
    words: str = ""

    PATTERN: ClassVar[re.Pattern[str]] = re.compile(
        r"(?P<title>[^:\s][^:]*): (?P<done>\d+)/(?P<total>\d+|\?)(?: (?P<words>.*))?"
    )

    def __str__(self) -> str:
        total = "?" if self.total is None else self.total
        return f"{self.title}: {self.done}/{total} {self.words}".rstrip()

    @classmethod
    def read(cls, line: str) -> "Progressed | None":
        """What a line of a log says; None if it is no line of progress."""
        found = cls.PATTERN.fullmatch(line.rstrip())
        if found is None:
            return None
        total = None if found["total"] == "?" else int(found["total"])
        return cls(found["title"], int(found["done"]), total, found["words"] or "")


class Bar:
    """One line of progress: a count out of a total, and a few words that change.

    Pieces that are under way side by side have a line each below it; a log names them in its line.
    """

    def __init__(
        self, progress: Progress, task: TaskID, title: str, total: int | None, done: int
    ) -> None:
        self._progress = progress
        self._task = task
        self._title = title
        self._total = total
        self._done = done
        self._logged = -math.inf  # the first line tells a reader of the log that work has begun
        self._pieces: dict[str, tuple[TaskID, str]] = {}

    def advance(self, steps: int = 1, note: str = "") -> None:
        """Count ``steps`` more as done; ``note`` replaces the words at the end of the line."""
        self._done += steps
        self._progress.update(self._task, advance=steps, note=note)
        if not console.is_terminal and time.monotonic() - self._logged > LOG_EVERY_S:
            self._logged = time.monotonic()
            pieces = "".join(f"{said}; " for _, said in self._pieces.values())
            say(str(Progressed(self._title, self._done, self._total, f"{pieces}{note}")))

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
def bar(title: str, total: int | None, done: int = 0) -> Iterator[Bar]:
    """Show progress while the block runs.

    Args:
        title: What is being done.
        total: How much there is; None if that is not known beforehand.
        done: How much of it was done before.
    """
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
        task = progress.add_task(title, total=total, completed=done, note="")
        yield Bar(progress, task, title, total, done)


def say(message: str) -> None:
    """Print one line of news about the work, on standard error."""
    console.print(printable(message), markup=False, soft_wrap=True)
