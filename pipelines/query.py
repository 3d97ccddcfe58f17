"""Queries of the lakehouse, shown or written."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pyarrow as pa
from rich.console import Console
from rich.table import Table
from rich.text import Text

from lmtr.errors import ConfigurationError
from pipelines.terminal import printable_text
from pipelines.workspace import Workspace
from services.lake.queries import plan, streamed, write_result
from services.lake.schemas import MADE_BY
from services.lake.views import VIEWS

SHOWN_ROWS = 100
SHOWN_RECORDS = 5
LEAST_COLUMN = 8
"""Characters that a column needs to say anything."""

UNFOLDED_WIDTH = 1000
SHOWN_ITEMS = 6


def query(workspace: Workspace, sql: str, form: str, out: Path | None) -> None:
    """Run one read-only query and show its result as a table, or write it.

    Raises:
        ConfigurationError: Parquet is asked for without a file, or a table with one.
        LakeError: The query is wrong or not allowed.
    """
    if form == "table" and out is not None:
        form = {".csv": "csv", ".json": "json", ".parquet": "parquet"}.get(out.suffix, form)
        if form == "table":
            raise ConfigurationError(
                f"query: cannot tell a format from {str(out)!r}; add --format csv, json or parquet"
            )
    if form == "parquet" and out is None and sys.stdout.isatty():
        raise ConfigurationError("query: parquet is binary; name a file with --out FILE.parquet")
    with streamed(workspace.lake, sql) as result:
        if form == "table":
            _show(result)
        else:
            write_result(result, out, form)


def explain(workspace: Workspace, sql: str) -> None:
    """Print how DuckDB would carry a query out."""
    Console(width=UNFOLDED_WIDTH).print(Text(plan(workspace.lake, sql)))


def list_tables(workspace: Workspace) -> None:
    """Print which tables and views a query may use."""
    table = Table("name", "kind", "a row is", header_style="bold")
    for name in workspace.lake.tables():
        made_by = Text(f"see docs/data.md; made by {MADE_BY[name]}")
        table.add_row(name, "table", made_by)
    for name, view in VIEWS.items():
        table.add_row(name, f"view of {', '.join(view.tables)}", view.meaning)
    Console().print(table)


def _show(result: pa.RecordBatchReader) -> None:
    """Print a table, or one record after the other where the columns are too many for the width."""
    # Off a terminal nothing is folded, so that what is printed can be copied and cut.
    console = Console() if sys.stdout.isatty() else Console(width=UNFOLDED_WIDTH)
    wide = console.width < LEAST_COLUMN * len(result.schema)
    limit = SHOWN_RECORDS if wide else SHOWN_ROWS
    first = _first(result, limit + 1)
    for shown in _records(first, limit) if wide else [_rows(first, limit)]:
        console.print(shown)
    if first.num_rows > limit:
        console.print(f"the first {limit} rows; use LIMIT, or --format csv for all")


def _first(result: pa.RecordBatchReader, count: int) -> pa.Table:
    """The first rows of a result, which is not read any further."""
    batches: list[pa.RecordBatch] = []
    while sum(batch.num_rows for batch in batches) < count:
        batch = next(iter(result), None)
        if batch is None:
            break
        batches.append(batch)
    return pa.Table.from_batches(batches, result.schema).slice(0, count)


def _rows(result: pa.Table, limit: int) -> Table:
    table = Table(header_style="bold")
    for field in result.schema:
        numeric = pa.types.is_integer(field.type) or pa.types.is_floating(field.type)
        table.add_column(
            printable_text(field.name), justify="right" if numeric else "left", overflow="fold"
        )
    for row in result.slice(0, limit).to_pylist():
        table.add_row(*(printable_text(_cell(value)) for value in row.values()))
    return table


def _records(result: pa.Table, limit: int) -> Iterator[Table]:
    for number, row in enumerate(result.slice(0, limit).to_pylist(), start=1):
        table = Table(title=f"row {number}", title_justify="left", show_header=False)
        table.add_column(style="bold", no_wrap=True)
        table.add_column(overflow="fold")
        for name, value in row.items():
            table.add_row(printable_text(name), printable_text(_cell(value)))
        yield table


def _cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, tuple) and len(value) == 2:  # an entry of a map
        return f"{value[0]}: {_cell(value[1])}"
    if isinstance(value, list):
        shown = [_cell(item) for item in value[:SHOWN_ITEMS]]
        rest = [f"… {len(value)} values"] if len(value) > SHOWN_ITEMS else []
        return f"[{', '.join([*shown, *rest])}]"
    return str(value)
