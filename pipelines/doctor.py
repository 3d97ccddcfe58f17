"""A look over the installation: what is there, what is compiled, what can be reached."""

import os
import platform
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from rich.console import Console
from rich.table import Table

from lmtr import __version__
from pipelines.provenance import code_version
from services.errors import ServiceError
from services.home import Home
from services.lake.tables import Lake

LIBRARIES = ("casadi", "torch", "ray", "mlflow", "duckdb", "deltalake", "pyarrow", "faiss-cpu")
LOW_DISK_GB = 5.0


@dataclass(frozen=True)
class Finding:
    """One thing looked at.

    Attributes:
        subject: What was looked at.
        state: What was found.
        mend: What to do about it; empty where all is well.
        fatal: Whether nothing works without it.
    """

    subject: str
    state: str
    mend: str = ""
    fatal: bool = False


def examine(root: Path) -> bool:
    """Print the findings for the home at ``root``; returns whether nothing fatal was found."""
    findings = [finding for look in _LOOKS for finding in look(root)]
    table = Table(title=f"LMTR {__version__}", header_style="bold")
    for column in ("", "what", "state", "what to do"):
        table.add_column(column, overflow="fold")
    for finding in findings:
        mark = "✗" if finding.fatal else "!" if finding.mend else "✓"
        table.add_row(mark, finding.subject, finding.state, finding.mend)
    Console().print(table)
    return not any(finding.fatal for finding in findings)


def _interpreter(_: Path) -> Iterator[Finding]:
    yield Finding("python", f"{platform.python_version()} at {sys.executable}")
    yield Finding("code", code_version())


def _libraries(_: Path) -> Iterator[Finding]:
    for name in LIBRARIES:
        try:
            yield Finding(name, metadata.version(name))
        except metadata.PackageNotFoundError:
            yield Finding(name, "missing", "install the project again: make install", fatal=True)


def _machine(root: Path) -> Iterator[Finding]:
    yield Finding("cores", str(os.cpu_count()))
    place = next(folder for folder in (root, *root.absolute().parents) if folder.exists())
    free = shutil.disk_usage(place).free / 1e9
    low = free < LOW_DISK_GB
    yield Finding("free disk", f"{free:.1f} GB", "make room: runs may fail half-way" if low else "")
    ffmpeg = shutil.which("ffmpeg")
    yield Finding("ffmpeg", ffmpeg or "none", "" if ffmpeg else "install it for mp4 (gif works)")


def _expert(root: Path) -> Iterator[Finding]:
    compiler = shutil.which("gcc") or shutil.which("cc")
    yield Finding(
        "C compiler",
        compiler or "none",
        "" if compiler else "install gcc: without it the expert is about a fifth slower",
    )
    built = sorted((root / "cache").glob("**/*.so")) if (root / "cache").is_dir() else []
    state = f"{len(built)} in the cache" if built else "none yet: the first solve compiles it"
    yield Finding("compiled experts", state)


def _home(root: Path) -> Iterator[Finding]:
    if not root.exists():
        yield Finding("home", f"{root} is not there yet", "make one: lmtr run demo")
        return
    try:
        home = Home.open(root, create=False)
        lake = Lake(home.lake)
        yield Finding("home", str(root))
        for name in lake.tables():
            rows = lake.query_value(f'SELECT count(*) FROM "{name}"')
            yield Finding(f"table {name}", f"{rows} rows, version {lake.version(name)}")
    except ServiceError as error:
        yield Finding("home", str(error), "mend this first", fatal=True)


_LOOKS: tuple[Callable[[Path], Iterator[Finding]], ...] = (
    _interpreter,
    _libraries,
    _machine,
    _expert,
    _home,
)
