"""Measure how fast the lake is read: queries against raw DuckDB, the loader against plain Arrow.

    lmtr --home build/small run demo
    python benchmarks/lake.py --home build/small --out build/lake

A million segments are made once of those in the home, with a little noise, through the lake's own
appends. Then both ways of reading take turns on the same files in one process, so that ratios stand
for what the lake adds.
"""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import duckdb
import numpy as np
import pyarrow as pa
import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table

from lmtr.errors import DataError
from pipelines.loader import load_segments
from pipelines.workspace import Workspace
from services.lake.digest import sealed
from services.lake.queries import query
from services.lake.sandbox import Files
from services.lake.schemas import SCHEMAS
from services.lake.tables import Lake
from services.lake.views import DOCUMENTED, VIEWS

NOISE = 1e-3
ROWS_A_COMMIT = 50_000


def main(
    home: Annotated[Path, typer.Option(help="Home whose solutions and segments are copied.")],
    out: Annotated[Path, typer.Option(help="Home of the copies, kept for the next time.")],
    rows: Annotated[int, typer.Option(min=1000, help="Segments to make.")] = 1_000_000,
    rounds: Annotated[int, typer.Option(min=1, help="Times that each pair is measured.")] = 9,
) -> None:
    """Make the segments, time both ways in turns, and print their ratios."""
    console = Console()
    lake = _filled(home, out / str(rows), rows)
    files = {name: _files(lake, name) for name in ("segments", "solutions")}
    size = sum(Path(path).stat().st_size for path in files["segments"])
    table = Table("what", "plain (ms)", "ours (ms)", "ratio", "quartiles")
    for title, sql in DOCUMENTED.items():
        plain, ours = _raw(files, sql), lambda sql=sql: query(lake, sql)
        # Copies cost the same, so which of them come first is anybody's choice.
        if "LIMIT" not in sql and not _alike(plain(), ours()):
            raise DataError(f"benchmark: {title}: both ways must answer alike; mend the lake")
        table.add_row(title, *_in_turns(plain, ours, rounds))
    dataset = lake.delta("segments").to_pyarrow_dataset
    table.add_row(
        "loading tensors / Arrow table",
        *_in_turns(
            lambda: dataset().to_table(columns=["x", "tau"]),
            lambda: load_segments(out / str(rows)),
            rounds,
        ),
    )
    table.caption = f"{rows} segments, {size / 1e9:.2f} GB in {len(files['segments'])} files"
    console.print(table)


def _files(lake: Lake, table: str) -> list[str]:
    source = lake.sources()[table]
    if not isinstance(source, Files):
        raise DataError(f"benchmark: table {table!r} is not read as files; use a new home")
    return list(source.paths)


def _raw(files: dict[str, list[str]], sql: str) -> Callable[[], pa.Table]:
    """The same query in DuckDB alone: a new connection, and the files."""

    def ask() -> pa.Table:
        with duckdb.connect(":memory:") as connection:
            connection.execute("SET TimeZone = 'UTC'")
            for name, paths in files.items():
                connection.execute(f"CREATE VIEW {name} AS FROM read_parquet({paths!r})")
            for name, view in VIEWS.items():
                if name in sql:
                    connection.execute(f"CREATE VIEW {name} AS {view.sql}")
            return connection.sql(sql).to_arrow_table()

    return ask


def _alike(one: pa.Table, other: pa.Table) -> bool:
    """Whether answers agree; means to nine digits, as threads add them up in any order."""
    if one.schema != other.schema or one.num_rows != other.num_rows:
        return False
    for a, b in zip(one.columns, other.columns, strict=True):
        if pa.types.is_list(a.type):
            a, b = a.combine_chunks().flatten(), b.combine_chunks().flatten()
        if pa.types.is_floating(a.type):
            if not np.allclose(a.to_numpy(), b.to_numpy(), rtol=1e-9, atol=0.0):
                return False
        elif not a.equals(b):
            return False
    return True


def _in_turns(
    plain: Callable[[], object], ours: Callable[[], object], rounds: int
) -> tuple[str, str, str, str]:
    """Medians of both, the median of the ratios of pairs, and its quartiles; the first warms up."""
    seconds = np.array([(_seconds(plain), _seconds(ours)) for _ in range(rounds + 1)])[1:]
    ratios = seconds[:, 1] / seconds[:, 0]
    low, middle, high = np.quantile(ratios, [0.25, 0.5, 0.75])
    a, b = 1e3 * np.median(seconds, axis=0)
    return f"{a:.0f}", f"{b:.0f}", f"{middle:.2f}", f"{low:.2f} … {high:.2f}"


def _seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    result = work()
    passed = time.perf_counter() - start
    del result
    return passed


def _filled(source: Path, place: Path, rows: int) -> Lake:
    """A home with so many segments, and the solutions that they would be of."""
    small = Workspace.open(source, create=False).lake
    lake = Workspace.open(place, create=True).lake
    segments = small.read("segments")
    copies = -(-rows // segments.num_rows)
    for name in ("datasets", "cuts"):
        lake.append(name, small.read(name), app_id="benchmark", number=1)
    _copied(lake, "solutions", small.read("solutions"), copies, None)
    _copied(lake, "segments", segments, copies, rows)
    return lake


def _copied(lake: Lake, table: str, rows: pa.Table, copies: int, most: int | None) -> None:
    """Append copies of rows under new indices, many copies a commit; what is there stays."""
    index = "index" if table == "solutions" else "solution_index"
    step = max(1, ROWS_A_COMMIT // rows.num_rows)
    stride = int(np.max(rows[index].to_numpy())) + 1
    starts = range(0, copies, step)
    for number, start in enumerate(track(starts, description=f"Making {table}"), start=1):
        if (lake.last_transaction(table, "benchmark") or 0) >= number:
            continue
        made = [
            _copy(table, rows, index, stride * copy, np.random.default_rng(copy))
            for copy in range(start, min(start + step, copies))
        ]
        batch = pa.concat_tables(made)
        if most is not None:
            batch = batch.slice(0, max(0, most - start * rows.num_rows))
        lake.append(table, sealed(table, batch), app_id="benchmark", number=number)


def _copy(table: str, rows: pa.Table, index: str, shift: int, rng: np.random.Generator) -> pa.Table:
    """Rows under other indices; vectors of segments with a little noise."""
    at = rows.schema.get_field_index(index)
    shifted = pa.array(rows[index].to_numpy() + shift)
    made = rows.set_column(at, rows.schema.field(at), shifted)
    for name in ("x", "tau") if table == "segments" else ():
        at, column = rows.schema.get_field_index(name), rows[name].combine_chunks()
        values = column.flatten().to_numpy()
        noisy = values + NOISE * rng.standard_normal(len(values), dtype=np.float32)
        vectors = pa.FixedSizeListArray.from_arrays(pa.array(noisy), column.type.list_size)
        made = made.set_column(at, rows.schema.field(at), vectors.cast(column.type))
    return made.cast(SCHEMAS[table])


if __name__ == "__main__":
    typer.run(main)
