"""SQL over the lake, read-only, and its result as CSV, JSON or Parquet."""

import csv
import io
import json
import math
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import date, datetime, time
from decimal import Decimal
from pathlib import Path
from typing import BinaryIO, TextIO, TypeAlias

import pyarrow as pa
import pyarrow.parquet as pq

from services.errors import LakeError
from services.files import whole_file
from services.lake.sandbox import evaluated
from services.lake.tables import Lake, Value

WRITTEN_ROWS = 1024

Json: TypeAlias = "bool | int | float | str | list[Json] | dict[str, Json] | None"


def query(lake: Lake, sql: str) -> pa.Table:
    """The result of one SELECT (or DESCRIBE, SHOW, SUMMARIZE, EXPLAIN) over the lake's tables.

    Columns of the same name are told apart by a number: ``a``, ``a_1``.

    Raises:
        LakeError: The statement is wrong, not allowed, or names what is not there.
    """
    with streamed(lake, sql) as result:
        return result.read_all()


@contextmanager
def streamed(lake: Lake, sql: str) -> Iterator[pa.RecordBatchReader]:
    """The same a batch at a time, valid inside the ``with`` block.

    Raises:
        LakeError: The statement is wrong, not allowed, or names what is not there.
    """
    with evaluated(lake.sources(), sql) as relation:
        found = relation.to_arrow_reader(WRITTEN_ROWS)
        names = _distinct(found.schema.names)
        schema = pa.schema(
            [field.with_name(name) for field, name in zip(found.schema, names, strict=True)]
        )
        renamed = (pa.RecordBatch.from_arrays(batch.columns, schema=schema) for batch in found)
        yield pa.RecordBatchReader.from_batches(schema, renamed)


def plan(lake: Lake, sql: str) -> str:
    """How DuckDB would carry a statement out.

    Raises:
        LakeError: As :func:`query`.
    """
    rows = query(lake, f"EXPLAIN {sql}").to_pylist()
    return "\n".join(row["explain_value"] for row in rows)


def write_result(result: pa.Table | pa.RecordBatchReader, path: Path | None, form: str) -> None:
    """Write a result, a batch at a time.

    Args:
        result: The result.
        path: File, which appears under its name only when it is whole; standard output if None.
        form: ``csv`` (lists and maps as JSON), ``json`` (one array of objects, NaN as null), or
            ``parquet``.

    Raises:
        LakeError: The format is unknown.
        OutputError: The file cannot be written.
    """
    if form not in WRITERS:
        raise LakeError(f"result: format must be one of {', '.join(WRITERS)}, got {form!r}")
    write = WRITERS[form]
    table = result.to_reader() if isinstance(result, pa.Table) else result
    if path is None:
        write(table, sys.stdout.buffer)
        sys.stdout.buffer.flush()
        return
    with whole_file(path) as partial, partial.open("wb") as file:
        write(table, file)


def _distinct(names: list[str]) -> list[str]:
    seen: Counter[str] = Counter()
    distinct = []
    for name in names:
        new = f"{name}_{seen[name]}" if seen[name] else name
        while new in distinct:
            seen[name] += 1
            new = f"{name}_{seen[name]}"
        seen[name] += 1
        distinct.append(new)
    return distinct


def _write_csv(table: pa.RecordBatchReader, file: BinaryIO) -> None:
    kinds = [field.type for field in table.schema]
    with _text(file) as text:
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(table.schema.names)
        for batch in table:
            columns = [column.to_pylist() for column in batch.columns]
            for row in zip(*columns, strict=True):
                cells = zip(row, kinds, strict=True)
                writer.writerow([_cell(_plain(value, kind)) for value, kind in cells])


def _write_json(table: pa.RecordBatchReader, file: BinaryIO) -> None:
    with _text(file) as text:
        text.write("[")
        separator = "\n"
        for batch in table:
            for row in batch.to_pylist():
                plain = {field.name: _plain(row[field.name], field.type) for field in table.schema}
                text.write(separator + json.dumps(_without_nan(plain), ensure_ascii=False))
                separator = ",\n"
        text.write("\n]\n")


def _write_parquet(table: pa.RecordBatchReader, file: BinaryIO) -> None:
    with pq.ParquetWriter(file, table.schema) as writer:
        for batch in table:
            writer.write_batch(batch)


WRITERS: dict[str, Callable[[pa.RecordBatchReader, BinaryIO], None]] = {
    "csv": _write_csv,
    "json": _write_json,
    "parquet": _write_parquet,
}


@contextmanager
def _text(file: BinaryIO) -> Iterator[TextIO]:
    """UTF-8 text into a binary file, which stays open."""
    text = io.TextIOWrapper(file, encoding="utf-8", newline="")
    try:
        yield text
    finally:
        text.flush()
        text.detach()


def _plain(value: Value, kind: pa.DataType) -> Json:
    """A value in the types that JSON has."""
    if value is None:
        return None
    if pa.types.is_map(kind):
        return {str(key): _plain(item, kind.item_type) for key, item in value}
    if pa.types.is_struct(kind):
        return {field.name: _plain(value[field.name], field.type) for field in kind}
    if pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind):
        return [_plain(item, kind.value_type) for item in value]
    if isinstance(value, datetime | date | time):
        return value.isoformat()
    if isinstance(value, Decimal):
        return int(value) if value == value.to_integral_value() else float(value)
    return value if isinstance(value, bool | int | float | str) else str(value)


def _without_nan(value: Json) -> Json:
    """JSON has no word for NaN and infinity: null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    return [_without_nan(item) for item in value] if isinstance(value, list) else value


def _cell(value: Json) -> bool | int | float | str | None:
    if isinstance(value, list | dict):
        return json.dumps(value, ensure_ascii=False)
    return str(value).lower() if isinstance(value, bool) else value
