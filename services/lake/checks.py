"""Rows against the schema of their table, before anything is written."""

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from services.errors import LakeError
from services.lake.schemas import FINITE, IDENTITY, SCHEMAS


def conform(table: str, rows: pa.Table) -> pa.Table:
    """The rows with their columns in the order of the table's schema.

    Raises:
        LakeError: A column is missing, unknown or of another type; a value is null or not finite
            where that is not allowed.
    """
    schema = SCHEMAS[table]
    _require_columns(table, rows, schema)
    ordered = rows.select(schema.names)
    for field in schema:
        _require_type(table, ordered.schema.field(field.name), field)
        if not field.nullable:
            _require_present(table, ordered, field.name)
    for name in FINITE.get(table, ()):
        _require_finite(table, ordered, name)
    return ordered.cast(schema)


def _require_columns(table: str, rows: pa.Table, schema: pa.Schema) -> None:
    missing = [name for name in schema.names if name not in rows.column_names]
    unknown = [name for name in rows.column_names if name not in schema.names]
    twice = len(rows.column_names) - len(set(rows.column_names))
    if missing or unknown or twice:
        raise LakeError(
            f"table {table!r}: its columns must be those of its schema, each once; missing: "
            f"{missing or 'none'}, unknown: {unknown or 'none'}, repeated: {twice}; "
            f"build rows with SCHEMAS[{table!r}]"
        )


def _require_type(table: str, found: pa.Field, expected: pa.Field) -> None:
    if not found.type.equals(expected.type):
        raise LakeError(
            f"table {table!r}: column {expected.name!r} must be {expected.type}, got "
            f"{found.type}; build rows with SCHEMAS[{table!r}]"
        )


def _require_present(table: str, rows: pa.Table, name: str) -> None:
    if rows[name].null_count:
        row = pc.index(pc.is_null(rows[name]), True).as_py()
        raise LakeError(
            f"table {table!r}: column {name!r} must have a value in every row, got none in "
            f"{identity(table, rows, row)}; give it one"
        )


def _require_finite(table: str, rows: pa.Table, name: str) -> None:
    if rows.num_rows == 0:
        return
    # A null inside a list becomes NaN here and is refused with the others.
    flat = rows[name].combine_chunks().flatten().to_numpy(zero_copy_only=False)
    finite = np.isfinite(flat).reshape(rows.num_rows, -1)
    if not finite.all():
        row, entry = (int(index) for index in np.argwhere(~finite)[0])
        value = flat.reshape(rows.num_rows, -1)[row, entry]
        raise LakeError(
            f"table {table!r}: column {name!r} must be finite, got {value} at entry {entry} of "
            f"{identity(table, rows, row)}; leave that row out or mend what made it"
        )


def identity(table: str, rows: pa.Table, row: int) -> str:
    """The columns that identify a row, for messages."""
    values = (f"{name}={rows[name][row].as_py()!r}" for name in IDENTITY[table])
    return f"row {row} ({', '.join(values)})"
