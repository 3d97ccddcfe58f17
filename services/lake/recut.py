"""Rows that are made together, where some of them are lost: the others go too, to be made anew.

Whoever makes such rows looks whether any row of a key is there, and then takes it for done. Which
keys a lost file held nobody can tell any more, but the log says between which bounds they lie: all
rows of the table within them are taken out. What is to go is noted in the commit that takes the
file out, and that it went in another, so that a repair that is killed in between is finished by the
next one.
"""

import json
from collections.abc import Collection, Iterator
from typing import TypeAlias

import pyarrow as pa
from deltalake import DeltaTable

from services.lake.delta import commit_nothing
from services.lake.schemas import MADE_TOGETHER
from services.lake.tables import Lake

PENDING = "lmtr.recut"
"""Note with the bounds of what is to be taken out."""

DONE = "lmtr.recut.done"
"""Note that all of it, up to this commit, was taken out."""

Bounds: TypeAlias = dict[str, tuple[int | str | None, int | str | None]]
"""Least and greatest value of each key column in a file, as far as the log has them."""


def bounds_of(delta: DeltaTable, table: str, paths: Collection[str]) -> list[Bounds]:
    """The bounds of the keys in files of an opened table."""
    actions = pa.table(delta.get_add_actions(flatten=True)).to_pylist()
    return [
        {key: (each.get(f"min.{key}"), each.get(f"max.{key}")) for key in MADE_TOGETHER[table]}
        for each in actions
        if each["path"] in paths
    ]


def noted(bounds: list[Bounds]) -> dict[str, str]:
    """The note that rows within these bounds are to be taken out."""
    return {PENDING: json.dumps(bounds)} if bounds else {}


def take_out(lake: Lake, table: str) -> int:
    """Take out what notes of a table say and has not gone yet; returns how many rows went.

    Raises:
        LakeError: The table cannot be read or written, or another process replaces its files.
        DeltaError, OSError: That it is done cannot be noted.
    """
    bounds = _pending(lake, table)
    if not bounds:
        return 0
    rows = lake.delete(table, " OR ".join(f"({_within(each)})" for each in bounds))
    commit_nothing(lake.delta(table), {DONE: f"{rows} rows"})
    return rows


def _pending(lake: Lake, table: str) -> list[Bounds]:
    bounds: list[Bounds] = []
    for commit in lake.history(table):
        if DONE in commit:
            break
        bounds += [each for each in json.loads(commit.get(PENDING, "[]")) if each not in bounds]
    return bounds


def _within(bounds: Bounds) -> str:
    """SQL for the rows between bounds."""
    return " AND ".join(_comparisons(bounds)) or "true"


def _comparisons(bounds: Bounds) -> Iterator[str]:
    for key, (least, greatest) in bounds.items():
        if least is not None:
            yield f"{key} >= {_literal(least)}"
        if greatest is not None:
            yield f"{key} <= {_literal(greatest)}"


def _literal(value: int | str) -> str:
    return str(value) if isinstance(value, int) else "'" + value.replace("'", "''") + "'"
