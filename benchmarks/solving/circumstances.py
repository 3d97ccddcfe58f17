"""Under what circumstances solves came about, as their file and what is drawn of them tell."""

import hashlib
import platform
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

import casadi as ca

import lmtr
from lmtr.errors import DataError
from lmtr.quality.filter import QualityThresholds
from pipelines.config import Configuration, fingerprint
from pipelines.provenance import code_version

SOURCES = (
    *("arrays.py", "errors.py", "settings.py", "streams.py"),
    *("expert", "geometry", "quality", "robot", "spline", "task", "trajectory"),
)
"""Modules and packages of ``lmtr`` that decide what a solve comes to and how it is judged."""

JUDGEMENT = ("quality/cost_model.py", "quality/filter.py", "quality/rules.py")
"""Those that decide no more than which solves are accepted."""


@dataclass(frozen=True)
class Circumstances:
    """What a result depends on.

    Attributes:
        code: Version and commit.
        sources: Digest of the code that solves, which tells more than the commit: it is the same
            after changes elsewhere, and another one if changes were not committed.
        day: Date of the run.
        processor: Model of the processor.
        casadi: Version of CasADi.
        compiled: Whether the expert ran as machine code.
        tasks: Number of tasks.
        seed: Their seed.
        settings: Digests of the sections that decide it.
    """

    code: str
    sources: str
    day: str
    processor: str
    casadi: str
    compiled: bool
    tasks: int
    seed: int
    settings: dict[str, str]


def circumstances(
    settings: Mapping[str, object],
    seed: int,
    tasks: int,
    *,
    compiled: bool,
    without: Iterable[str] = (),
) -> Circumstances:
    """Those of a run here and now.

    Args:
        settings: Sections that decide it, by name.
        seed: Seed of the tasks.
        tasks: Their number.
        compiled: Whether the expert runs as machine code.
        without: Modules of ``SOURCES`` that have no part in it.
    """
    return Circumstances(
        code=code_version(),
        sources=sources(without),
        day=date.today().isoformat(),
        processor=processor(),
        casadi=ca.CasadiMeta.version(),
        compiled=compiled,
        tasks=tasks,
        seed=seed,
        settings={name: fingerprint(section) for name, section in settings.items()},
    )


def sections(config: Configuration) -> dict[str, object]:
    """Sections of a configuration that decide how tasks are solved and judged."""
    return {
        "robot": config.dataset.robot,
        "tasks": config.tasks,
        "expert": config.expert,
        "quality": config.quality,
    }


def verdict_by(thresholds: QualityThresholds) -> dict[str, str]:
    """By which code and thresholds solves that were kept without a verdict are judged."""
    return {"code": code_version(), "quality": fingerprint(thresholds)}


def sources(without: Iterable[str] = ()) -> str:
    """Eight hexadecimal digits of a digest of the code that solves."""
    root = Path(lmtr.__file__).resolve().parent
    left_out = {root / name for name in without}
    digest = hashlib.sha256()
    for name in SOURCES:
        place = root / name
        for path in sorted(place.rglob("*.*")) if place.is_dir() else [place]:
            if path.suffix in (".py", ".c") and path not in left_out:
                digest.update(str(path.relative_to(root)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:8]


def processor() -> str:
    """The processor's model, as the system tells it."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    models = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(models, f"{platform.machine()} {platform.processor()}".strip())


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
    if now.compiled != before.compiled:
        notes.append(f"it was recorded {_way(before)}, this is {_way(now)}")
    if (now.tasks, now.seed) != (before.tasks, before.seed):
        notes.append(f"it was recorded on {before.tasks} tasks of seed {before.seed}")
    if changed := changed_settings(now, before):
        notes.append(f"settings differ: {', '.join(changed)}")
    return notes


def changed_settings(now: Circumstances, before: Circumstances) -> list[str]:
    """Sections that are not as they were."""
    return [name for name, key in now.settings.items() if before.settings.get(name) != key]


def made_by(head: Mapping[str, Any], benchmark: str) -> Circumstances:
    """Circumstances of kept solves, from the head of their file.

    Raises:
        DataError: The file does not tell.
    """
    try:
        return Circumstances(**head["circumstances"])
    except (KeyError, TypeError) as error:
        raise DataError(
            f"{benchmark}: the kept solves do not tell what made them ({error}); solve once more, "
            "without --redraw and --resume"
        ) from error


def require_same(made: Circumstances, now: Circumstances, benchmark: str, option: str) -> None:
    """Refuse to pass solves of other code or settings off as those of the present ones.

    Args:
        made: What made the solves.
        now: The present code and settings.
        benchmark: Name of the benchmark, for the message.
        option: What was asked for, likewise.

    Raises:
        DataError: They are of other code or settings.
    """
    changed = [] if made.sources == now.sources else [f"code (solved by {made.code})"]
    if settings := changed_settings(now, made):
        changed.append(f"settings ({', '.join(settings)})")
    if changed:
        raise DataError(
            f"{benchmark}: {option} needs solves of the present code and settings, but the kept "
            f"ones of {made.day} are of other {' and '.join(changed)}; solve once more"
        )


def _way(of: Circumstances) -> str:
    return "as machine code" if of.compiled else "interpreted"
