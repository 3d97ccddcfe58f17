"""How what was found is shown: tables for people, JSON and CSV for programs."""

import csv
import json
import sys
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Literal

from rich.console import Console
from rich.table import Table

from pipelines.terminal import printable_text

UNFOLDED_WIDTH = 1000
"""Off a terminal nothing is folded, so that what is printed can be copied and cut."""

Record = Mapping[str, object]


def print_records(records: Sequence[Record], form: str, title: str = "") -> None:
    """Print records of the same keys as ``table``, ``csv`` or ``json`` (an array of objects)."""
    if form == "json":
        print_json(list(records))
    elif form == "csv":
        writer = csv.writer(sys.stdout, lineterminator="\n")
        writer.writerow(records[0] if records else [])
        writer.writerows(list(record.values()) for record in records)
    else:
        _print_table(records, title)


def print_json(value: object) -> None:
    """Print plain values as JSON; times in ISO format, NaN as null."""
    print(json.dumps(_plain(value), ensure_ascii=False, indent=1))


def said(message: str) -> None:
    """Print one line of a result."""
    _console().print(printable_text(message), soft_wrap=True)


def size(nbytes: int) -> str:
    """Bytes for people."""
    for unit, scale in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if nbytes >= scale:
            return f"{nbytes / scale:.1f} {unit}"
    return f"{nbytes} B"


def counted(number: int, noun: str) -> str:
    """A number and what it counts, in the plural where there is more or less than one."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def cell(value: object) -> str:
    """A value for people; nothing for what is not there."""
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.5g}"
    if isinstance(value, datetime):
        return value.strftime("%Y-%m-%d %H:%M:%S")
    if isinstance(value, Mapping):
        return ", ".join(f"{key}={cell(item)}" for key, item in value.items())
    return str(value)


def _print_table(records: Sequence[Record], title: str) -> None:
    table = Table(title=title or None, title_justify="left", header_style="bold")
    for name in records[0] if records else ():
        numeric = _is_numeric([record[name] for record in records])
        justify: Literal["left", "right"] = "right" if numeric else "left"
        # A number that is cut in two is another number.
        table.add_column(name, justify=justify, overflow="fold", no_wrap=numeric)
    for record in records:
        table.add_row(*(printable_text(cell(value)) for value in record.values()))
    _console().print(table)


def _is_numeric(values: Sequence[object]) -> bool:
    there = [value for value in values if value is not None]
    return bool(there) and all(
        isinstance(value, int | float) and not isinstance(value, bool) for value in there
    )


def _console() -> Console:
    return Console() if sys.stdout.isatty() else Console(width=UNFOLDED_WIDTH)


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, datetime):
        return value.isoformat()
    if isinstance(value, float) and value - value != 0.0:  # NaN and infinity
        return None
    return value
