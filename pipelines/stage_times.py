"""How long the stages of a study took, kept so that a resumed run adds to what went before."""

import json
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from pipelines.progress import say
from services.files import whole_file

SHOWN = 3
"""Longest stages that are named at the end."""


class StageTimes:
    """Seconds by configuration and stage.

    Args:
        path: File that keeps them; it may be missing.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._seconds: dict[str, dict[str, float]] = {}
        if path.is_file():
            try:
                self._seconds = json.loads(path.read_text(encoding="utf-8"))
            except ValueError:
                say(f"run: {path} is damaged; stages are timed anew")

    @property
    def seconds(self) -> Mapping[str, Mapping[str, float]]:
        """By configuration and stage, of this run and of those that it goes on with."""
        return self._seconds

    @contextmanager
    def of(self, configuration: str, stage: str) -> Iterator[None]:
        """Time what is done in the block, be it finished or stopped."""
        began = time.monotonic()
        try:
            yield
        finally:
            stages = self._seconds.setdefault(configuration, {})
            stages[stage] = stages.get(stage, 0.0) + time.monotonic() - began
            with whole_file(self._path) as partial:
                partial.write_text(json.dumps(self._seconds, indent=1), encoding="utf-8")

    def tell(self) -> None:
        """Say what took longest."""
        took = sorted(
            (
                (seconds, f"{stage} ({name})" if len(self._seconds) > 1 else stage)
                for name, stages in self._seconds.items()
                for stage, seconds in stages.items()
            ),
            reverse=True,
        )
        total = sum(seconds for seconds, _ in took)
        if total > 0.0:
            longest = ", ".join(
                f"{stage} {seconds:.0f} s ({100.0 * seconds / total:.0f} %)"
                for seconds, stage in took[:SHOWN]
            )
            say(f"Stages:      {total:.0f} s in all; most in {longest}")
