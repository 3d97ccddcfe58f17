"""Measure commits: one writer against 64 at once, and count rows that are lost or doubled.

    python -m benchmarks.commits --writers 64

Writers are threads of this process, for delta-rs lets go of Python while it works. They append rows
of the size of solutions to one table: one writer alone; all writers, each with a data set of its
own; and all writers with the same rows of one data set.
"""

import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Annotated

import pyarrow as pa
import typer
from rich.console import Console
from rich.table import Table

from benchmarks.scaling import rows_like_solutions
from services.lake.appender import Appender, Group
from services.lake.tables import Lake


def main(
    writers: Annotated[int, typer.Option(min=2, help="Writers at once.")] = 64,
    commits: Annotated[int, typer.Option(min=1, help="Commits of each of them.")] = 4,
    rows: Annotated[int, typer.Option(min=1, help="Rows of a commit.")] = 100,
) -> None:
    """Append in all three ways and print rates."""
    table = Table("who", "commits", "rows", "rows/s", "commits/s", "lost", "doubled")
    batches = [rows_like_solutions(k * rows, rows) for k in range(commits)]
    own = [f"own{k}" for k in range(writers)]
    cases: tuple[tuple[str, list[str]], ...] = (
        ("one writer", ["alone"]),
        (f"{writers} writers, a data set each", own),
        (f"{writers} writers of the same rows", ["shared"] * writers),
    )
    for name, datasets in cases:
        with tempfile.TemporaryDirectory() as folder:
            table.add_row(name, *_case(Path(folder) / "lake", datasets, batches))
    Console().print(table)


def _case(place: Path, datasets: list[str], batches: list[pa.Table]) -> list[str]:
    Lake(place).open_or_create("solutions")
    began = time.perf_counter()
    with ThreadPoolExecutor(len(datasets)) as pool:
        list(pool.map(_writer(place, batches), datasets))
    seconds = time.perf_counter() - began
    found = Lake(place).read("solutions", ["dataset_id", "index"])
    identities = list(zip(*(found[name].to_pylist() for name in found.column_names), strict=True))
    wanted = len(set(datasets)) * sum(batch.num_rows for batch in batches)
    made = Lake(place).version("solutions")
    return [
        f"{made}",
        f"{len(identities)}",
        f"{len(identities) / seconds:,.0f}",
        f"{made / seconds:.1f}",
        f"{wanted - len(set(identities))}",
        f"{len(identities) - len(set(identities))}",
    ]


def _writer(place: Path, batches: list[pa.Table]) -> Callable[[str], None]:
    def write(dataset: str) -> None:
        appender = Appender(Lake(place), Group("solutions", {"dataset_id": dataset}, "index"))
        for batch in batches:
            names = pa.array([dataset] * batch.num_rows)
            at = batch.schema.get_field_index("dataset_id")
            appender.append(batch.set_column(at, batch.schema.field(at), names))

    return write


if __name__ == "__main__":
    typer.run(main)
