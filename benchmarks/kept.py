"""Rows that a benchmark keeps in a file, so that it can be drawn again without solving again."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lmtr.errors import DataError

Row = dict[str, Any]

_ROWS = "solves"


def write_rows(path: Path, head: Mapping[str, Any], rows: Sequence[Row]) -> None:
    """Keep rows, one on a line, under a head that says what they belong to.

    A run that is cut off leaves the file as it was.
    """
    entries = [f"{json.dumps(key)}: {json.dumps(value)}" for key, value in head.items()]
    lines = ",\n".join(json.dumps(row) for row in rows)
    entries.append(f'"{_ROWS}": [\n{lines}\n]')
    partial = path.with_name(path.name + ".partial")
    partial.write_text("{" + ",\n".join(entries) + "}\n", encoding="utf-8")
    partial.replace(path)


def read_rows(path: Path, benchmark: str) -> tuple[dict[str, Any], list[Row]]:
    """Head and rows that :func:`write_rows` kept.

    Args:
        path: The file.
        benchmark: Name of the benchmark that asks, for the message.

    Raises:
        DataError: There are none.
    """
    if not path.is_file():
        raise DataError(f"{benchmark}: {path} does not exist; solve first, without --redraw")
    try:
        head = json.loads(path.read_text(encoding="utf-8"))
        return head, head.pop(_ROWS)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise DataError(
            f"{benchmark}: {path} holds no rows of solves ({error}); delete it and solve again"
        ) from error
