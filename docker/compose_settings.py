"""Compose's own file of settings, ``.env``: what the user wrote, and below it what we keep there.

What is kept makes a start by hand, and a later `make cluster`, mean the same cluster.
"""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

BEGIN = "# kept by `make cluster`, which writes it anew; lines of your own go above"


def read(file: Path) -> tuple[dict[str, str], dict[str, str]]:
    """What the user wrote, and what an earlier start has kept."""
    if not file.exists():
        return {}, {}
    lines = file.read_text(encoding="utf-8").splitlines()
    own = lines.index(BEGIN) if BEGIN in lines else len(lines)
    return _pairs(lines[:own]), _pairs(lines[own:])


def keep(file: Path, settings: Mapping[str, str]) -> None:
    """Replace what is kept, but for what the user's own lines say."""
    before = file.read_text(encoding="utf-8") if file.exists() else ""
    own = before.partition(BEGIN)[0]
    said = _pairs(own.splitlines())
    kept = "".join(f"{name}={value}\n" for name, value in settings.items() if name not in said)
    text = own if not own or own.endswith("\n") else f"{own}\n"
    partial = file.with_name(f".{file.name}.{os.getpid()}")
    partial.write_text(f"{text}{BEGIN}\n{kept}", encoding="utf-8")
    os.replace(partial, file)


def _pairs(lines: Iterable[str]) -> dict[str, str]:
    stripped = (line.strip() for line in lines)
    pairs = (line.split("=", 1) for line in stripped if "=" in line and not line.startswith("#"))
    return {name.strip(): value.strip().strip("\"'") for name, value in pairs}
