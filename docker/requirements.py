"""What an image installs before the code, so that a change of code installs nothing again.

python requirements.py PYPROJECT [EXTRA...] > requirements.txt
"""

import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path

ALL = "."
"""Stands for what the package cannot do without, among the names of extras."""


def requirements(pyproject: Path, wanted: Sequence[str]) -> list[str]:
    """The requirements of the extras that are named, one each."""
    project = tomllib.loads(pyproject.read_text(encoding="utf-8"))["project"]
    extras: dict[str, list[str]] = {
        ALL: project["dependencies"],
        **project["optional-dependencies"],
    }
    return [requirement for name in wanted for requirement in extras[name]]


if __name__ == "__main__":
    print("\n".join(requirements(Path(sys.argv[1]), sys.argv[2:])))
