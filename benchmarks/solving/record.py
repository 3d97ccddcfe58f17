"""The last recorded result of each robot, in ``benchmarks/results/``; its history is git's."""

import json
import math
import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.solving.figures import Better, Figure, Summary
from lmtr.errors import DataError
from pipelines.config import Configuration, fingerprint
from pipelines.provenance import code_version

RESULTS = Path(__file__).resolve().parent.parent / "results" / "expert.json"

NOTEWORTHY = 0.05
"""Relative change from which on a figure counts as better or worse."""


@dataclass(frozen=True)
class Circumstances:
    """What a result depends on.

    Attributes:
        code: Version and commit.
        day: Date of the run.
        processor: Model of the processor.
        casadi: Version of CasADi.
        tasks: Number of tasks.
        seed: Their seed.
        settings: Digests of the sections that decide it.
    """

    code: str
    day: str
    processor: str
    casadi: str
    tasks: int
    seed: int
    settings: dict[str, str]


@dataclass(frozen=True)
class Result:
    """A summary and how it came about."""

    circumstances: Circumstances
    summary: Summary


def circumstances(config: Configuration, seed: int, tasks: int, casadi: str) -> Circumstances:
    """Those of a run here and now."""
    sections = {
        "robot": config.dataset.robot,
        "tasks": config.tasks,
        "expert": config.expert,
        "quality": config.quality,
    }
    return Circumstances(
        code=code_version(),
        day=date.today().isoformat(),
        processor=processor(),
        casadi=casadi,
        tasks=tasks,
        seed=seed,
        settings={name: fingerprint(section) for name, section in sections.items()},
    )


def processor() -> str:
    """The processor's model, as the system tells it."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    models = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(models, f"{platform.machine()} {platform.processor()}".strip())


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


def differences(now: Circumstances, before: Circumstances) -> list[str]:
    """What else than the code has changed since the record, in words."""
    notes = []
    if now.processor != before.processor:
        notes.append(
            f"it was recorded on another machine ({before.processor}; here {now.processor}), so "
            "the ratios marked ≠ compare machines"
        )
    if now.casadi != before.casadi:
        notes.append(f"it was recorded with CasADi {before.casadi}, here {now.casadi}")
    if (now.tasks, now.seed) != (before.tasks, before.seed):
        notes.append(f"it was recorded on {before.tasks} tasks of seed {before.seed}")
    changed = [name for name, key in now.settings.items() if before.settings.get(name) != key]
    if changed:
        notes.append(f"settings differ: {', '.join(changed)}")
    return notes


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
