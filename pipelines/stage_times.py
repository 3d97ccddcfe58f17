"""How long the stages of a study took, kept so that a resumed run adds to what went before."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from pydantic import BaseModel, TypeAdapter

from pipelines.progress import say
from services.files import whole_file

SHOWN = 3
"""Longest stages that are named at the end."""


class Kept(BaseModel):
    """What the stages of one configuration took.

    Attributes:
        digest: Of its settings.
        seconds: By stage.
    """

    digest: str
    seconds: dict[str, float] = {}


_FILE = TypeAdapter(dict[str, Kept])


class StageTimes:
    """Seconds by configuration and stage.

    Args:
        path: File that keeps them; it may be missing.
        digests: Of the settings of each configuration, by its name. What other settings of that
            name took is forgotten.
    """

    def __init__(self, path: Path, digests: Mapping[str, str]) -> None:
        self._path = path
        self._kept = {name: Kept(digest=digest) for name, digest in digests.items()}
        for name, each in self._read().items():
            if each.digest == digests.get(name):
                self._kept[name] = each

    @property
    def seconds(self) -> Mapping[str, Mapping[str, float]]:
        """By configuration and stage, of this run and of those that it goes on with."""
        return {name: each.seconds for name, each in self._kept.items() if each.seconds}

    @contextmanager
    def of(self, configuration: str, stage: str) -> Iterator[None]:
        """Time what is done in the block, be it finished or stopped."""
        began = time.monotonic()
        try:
            yield
        finally:
            stages = self._kept[configuration].seconds
            stages[stage] = stages.get(stage, 0.0) + time.monotonic() - began
            with whole_file(self._path) as partial:
                partial.write_bytes(_FILE.dump_json(self._kept, indent=1))

    def _read(self) -> dict[str, "Kept"]:
        if not self._path.is_file():
            return {}
        try:
            return _FILE.validate_json(self._path.read_bytes())
        except ValueError:
            say(f"run: {self._path} is damaged or of an older version; stages are timed anew")
            return {}

    def tell(self) -> None:
        """Say what took longest."""
        took = sorted(
            (
                (seconds, f"{stage} ({name})" if len(self.seconds) > 1 else stage)
                for name, stages in self.seconds.items()
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
