"""Compose's own file of settings, ``.env``: what we keep there, and below it the user's lines.

What is kept makes a start by hand, and a later `make cluster`, mean the same cluster. Compose takes
the last of two lines about the same, so the user's count.
"""

import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

BEGIN = "# kept by `make cluster`, which writes these lines anew; yours go below"
END = "# end of what is kept"

PLAIN = re.compile(r"[\w./:@%+,=-]*")
"""Values that every reader of such files takes as they are."""


@dataclass(frozen=True)
class Dotenv:
    """What a file of settings says.

    Attributes:
        own: By the user.
        kept: By an earlier start.
    """

    own: dict[str, str]
    kept: dict[str, str]

    @classmethod
    def of(cls, file: Path) -> "Dotenv":
        """Read a file; without one nothing is said."""
        own, kept = _divided(file)
        return cls(_pairs(own), _pairs(kept))


def keep(file: Path, settings: Mapping[str, str]) -> None:
    """Replace what is kept; the user's lines stay as they are.

    Raises:
        ValueError: A value cannot be written such that all versions of Compose read it.
    """
    own, _ = _divided(file)
    kept = [f"{name}={_written(name, value)}" for name, value in sorted(settings.items())]
    text = "".join(f"{line}\n" for line in (BEGIN, *kept, END, *own))
    partial = file.with_name(f"{file.name}.{os.getpid()}")
    partial.write_text(text, encoding="utf-8")
    os.replace(partial, file)


def _divided(file: Path) -> tuple[list[str], list[str]]:
    """Lines of the user's, wherever they are, and those that are kept."""
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    if BEGIN not in lines or END not in lines:
        return lines, []
    begin, end = lines.index(BEGIN), lines.index(END)
    return [*lines[:begin], *lines[end + 1 :]], lines[begin + 1 : end]


def _written(name: str, value: str) -> str:
    if PLAIN.fullmatch(value):
        return value
    if "'" in value or "\n" in value:
        raise ValueError(f"{name}: {value!r} has a quote or a line's end in it; use another one")
    return f"'{value}'"


def _pairs(lines: Iterable[str]) -> dict[str, str]:
    """Names and values as Compose reads them, as far as no other variable is named in a value."""
    pairs = {}
    for line in lines:
        found = re.match(r"\s*(?:export\s+)?([A-Za-z_]\w*)\s*=\s*(.*)$", line)
        if found is not None:
            name, value = found.groups()
            quoted = re.match(r"(['\"])(.*?)\1", value)
            pairs[name] = quoted[2] if quoted else re.split(r"(?:^|\s)#", value)[0].strip()
    return pairs
