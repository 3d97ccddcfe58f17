"""How the user can type what we suggest, from where they stand."""

import shlex
import shutil
import sys
from pathlib import Path

from pipelines.workspace import Workspace


def command(workspace: Workspace) -> str:
    """``lmtr --home …`` for this home: by name where ``lmtr`` is on the path."""
    known = shutil.which("lmtr") is not None
    program = "lmtr" if known else str(short(Path(sys.argv[0]).absolute()))
    home = workspace.home
    place = str(short(home.root)) if home.access is None else home.name
    return f"{shlex.quote(program)} --home {shlex.quote(place)}"


def short(path: Path) -> Path:
    """The path as seen from here, where it lies below."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path
