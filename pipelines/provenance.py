"""Which code made a row, a model or a rollout."""

import functools
import subprocess
from pathlib import Path

from lmtr import __version__

COMMIT_FILE = "commit"
"""What an image is built with has the commit in a file of this name."""


@functools.cache
def code_version() -> str:
    """Version of the package, with the commit it runs from where that can be told.

    ``.dirty`` marks a checkout with uncommitted changes. An image has no checkout: there the commit
    lies beside this file.
    """
    root = Path(__file__).resolve().parent.parent
    if not (root / ".git").exists():
        return _packaged(Path(__file__).with_name(COMMIT_FILE))
    try:
        commit = _git(root, "rev-parse", "--short=12", "HEAD")
        dirty = _git(root, "status", "--porcelain", "--untracked-files=no")
    except (OSError, subprocess.SubprocessError):
        return __version__
    return f"{__version__}+{commit}" + (".dirty" if dirty else "")


def _packaged(file: Path) -> str:
    commit = file.read_text(encoding="ascii").strip() if file.exists() else ""
    return f"{__version__}+{commit}" if commit else __version__


def _git(root: Path, *arguments: str) -> str:
    done = subprocess.run(
        ["git", "-C", str(root), *arguments], capture_output=True, text=True, check=True, timeout=10
    )
    return done.stdout.strip()
