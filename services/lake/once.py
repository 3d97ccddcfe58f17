"""Rows that one piece of work makes together, appended unless they are there.

A transaction alone does not tell: its number stays in the log when a repair has taken its rows out.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from services.lake.schemas import IDENTITY, MADE_TOGETHER
from services.lake.tables import Lake


def append_once(lake: Lake, table: str, rows: Sequence[Mapping[str, Any]], app_id: str) -> bool:
    """Append the rows of one piece of work, unless the table holds any of that work.

    Args:
        lake: The lake.
        table: Name of the table.
        rows: All rows of the work; missing columns are null.
        app_id: The work's own name; of two that do it at once one is kept.

    Returns:
        Whether they were appended.

    Raises:
        LakeError: The rows break the schema, or the table cannot be read or written.
    """
    number = lake.next_number(table, app_id)  # before the look: who comes after it takes the number
    if rows and _is_there(lake, table, rows[0]):
        return False
    return lake.append_rows(table, rows, app_id=app_id, number=number)


def _is_there(lake: Lake, table: str, row: Mapping[str, Any]) -> bool:
    keys = MADE_TOGETHER.get(table, IDENTITY[table])
    where = " AND ".join(f'"{key}" = {_literal(row[key])}' for key in keys)
    return lake.exists(table) and lake.read(table, keys[:1], where, limit=1).num_rows > 0


def _literal(value: object) -> str:
    return "'" + str(value).replace("'", "''") + "'"
