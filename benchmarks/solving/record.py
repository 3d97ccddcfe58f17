"""The last recorded result of each robot, in ``benchmarks/results/``; its history is git's."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.solving.circumstances import Circumstances
from benchmarks.solving.figures import Better, Figure, Summary
from lmtr.errors import DataError

RESULTS = Path(__file__).resolve().parent.parent / "results" / "expert.json"

NOTEWORTHY = 0.05
"""Relative change from which on a figure counts as better or worse."""


@dataclass(frozen=True)
class Result:
    """A summary and how it came about."""

    circumstances: Circumstances
    summary: Summary


def read_record(robot: str, path: Path = RESULTS) -> Result | None:
    """The recorded result of a robot, none if there is none.

    Raises:
        DataError: The file is no record.
    """
    kept = _read(path).get(robot)
    if kept is None:
        return None
    try:
        summary = {key: np.nan if v is None else float(v) for key, v in kept["summary"].items()}
        return Result(Circumstances(**kept["circumstances"]), summary)
    except (KeyError, TypeError, AttributeError) as error:
        raise DataError(
            f"benchmark: the record of robot {robot!r} in {path} is of another form ({error}); "
            "record it again"
        ) from error


def write_record(robot: str, result: Result, path: Path = RESULTS) -> None:
    """Replace the recorded result of a robot; four digits are what a figure is good for."""
    summary = {key: float(f"{value:.4g}") for key, value in result.summary.items()}
    entry = {"circumstances": asdict(result.circumstances), "summary": summary}
    kept = {**_read(path), robot: plain(entry)}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(kept, indent=1, sort_keys=True, ensure_ascii=False) + "\n")


def plain(value: object) -> object:
    """What JSON can hold of dictionaries, sequences and numbers; what is not finite is null."""
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def ratio(now: Summary, before: Summary, figure: Figure) -> float:
    """A figure over its recorded value; NaN where that says nothing."""
    new, old = now.get(figure.key, np.nan), before.get(figure.key, np.nan)
    return new / old if old else np.nan


def has_worsened(figure: Figure, quotient: float) -> bool | None:
    """Whether a ratio shows a change for the worse; none if it shows no change worth a note."""
    small = not abs(quotient - 1.0) > NOTEWORTHY
    if small or figure.better == Better.NEITHER:
        return None
    return (quotient > 1.0) == (figure.better == Better.LOWER)


def _read(path: Path) -> dict[str, Any]:
    if not path.exists():
        return {}
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise DataError(f"benchmark: {path} is no JSON ({error}); restore it from git") from error
    if not isinstance(content, dict):
        raise DataError(f"benchmark: {path} holds no record by robot; restore it from git")
    return content
