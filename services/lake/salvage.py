"""Rows brought back from files that lie outside their table.

Files are read twice: first their rows are judged and DuckDB learns, on the disk, which identity
lies where; then it tells which rows the table lacks, and those are read and appended. So memory
grows neither with the files nor with the table.
"""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.dataset as pads
import pyarrow.fs as pafs
from deltalake import CommitProperties, Transaction, write_deltalake

from services.lake.examination import Examiner, file_batches, read_schema
from services.lake.identity import listed
from services.lake.schemas import IDENTITY, SCHEMAS
from services.lake.tables import Lake

APP_ID = "lmtr-repair"

MEMORY = "512MB"
"""What DuckDB may take before it goes on on the disk."""


@dataclass(frozen=True)
class Salvaged:
    """What came of it.

    Attributes:
        rows: Rows that were appended.
        refused: Rows that the table lacks, but that are damaged in every file.
    """

    rows: int = 0
    refused: int = 0


def salvage(lake: Lake, table: str, sources: Sequence[str]) -> Salvaged:
    """Append the undamaged rows of files that a table lacks, each once, in one transaction.

    Args:
        lake: The lake.
        table: Name of the table.
        sources: Paths of the files, relative to the table.

    Raises:
        LakeError: The table cannot be opened.
        duckdb.Error, DeltaError, OSError: It cannot be read or written, or the disk is full.
    """
    files = lake.files(table)
    with tempfile.TemporaryDirectory(prefix="lmtr-repair-") as name:
        folder = Path(name)
        with _Offers(folder, table) as offers:
            for number, path in enumerate(sources):
                offers.look(number, _readable_part(files, path, table))
            kept = lake.dataset(table, lake.delta(table)) if lake.exists(table) else None
            found = offers.settle(kept)
            if not found.rows:
                return found
            # By way of the disk: delta-rs cannot read its own storage while it writes to it.
            spool = folder / "rows"
            with pa.ipc.new_stream(str(spool), SCHEMAS[table]) as writer:
                for number, path in enumerate(sources):
                    for rows in _taken(_readable_part(files, path, table), offers.chosen(number)):
                        writer.write_table(rows.cast(SCHEMAS[table]))
        _append(lake, table, spool, len(sources))
    return found


def _append(lake: Lake, table: str, spool: Path, files: int) -> None:
    properties = CommitProperties(
        app_transactions=[Transaction(APP_ID, lake.next_number(table, APP_ID))],
        custom_metadata={"lmtr.repair": f"rows salvaged from {files} files"},
    )
    with pa.OSFile(str(spool)) as file:
        rows = pa.ipc.open_stream(file)
        delta = lake.open_or_create(table)
        write_deltalake(delta, rows, mode="append", commit_properties=properties)


def _readable_part(files: pafs.FileSystem, path: str, table: str) -> Iterator[pa.Table]:
    """The batches of a file up to where it is damaged."""
    try:
        yield from file_batches(files, path, table)
    except (pa.ArrowException, OSError):
        return


def _taken(batches: Iterator[pa.Table], positions: np.ndarray) -> Iterator[pa.Table]:
    """The rows at positions, which ascend."""
    start = 0
    for batch in batches:
        first, last = np.searchsorted(positions, [start, start + len(batch)])
        if last > first:
            yield batch.take(pa.array(positions[first:last] - start))
        start += len(batch)


class _Offers:
    """Identities of the rows in files, on the disk."""

    def __init__(self, folder: Path, table: str) -> None:
        self._table = table
        self._keys = listed(table)
        self._examiner = Examiner(table)
        self._connection = duckdb.connect(
            str(folder / "identities.duckdb"), config={"memory_limit": MEMORY}
        )
        empty = read_schema(table).empty_table().select(IDENTITY[table])
        self._connection.register("identities", empty)
        self._connection.execute(
            "CREATE TABLE offered AS SELECT *, 0::INTEGER AS source, 0::BIGINT AS position, "
            "true AS sound FROM identities"
        )

    def __enter__(self) -> "_Offers":
        return self

    def __exit__(self, *_: object) -> None:
        self._examiner.__exit__()
        self._connection.close()

    def look(self, source: int, batches: Iterator[pa.Table]) -> None:
        """Judge the rows of a file and note where they are."""
        start = 0
        for batch in batches:
            sound = np.ones(len(batch), dtype=bool)
            for broken in self._examiner.examine(batch).broken:
                sound[broken.rows] = False
            offered = batch.select(IDENTITY[self._table])
            offered = offered.append_column("position", pa.array(np.arange(len(batch)) + start))
            offered = offered.append_column("sound", pa.array(sound))
            self._connection.register("batch", offered)
            self._connection.execute(
                f"INSERT INTO offered BY NAME SELECT *, {int(source)} AS source FROM batch"
            )
            self._connection.unregister("batch")
            start += len(batch)

    def settle(self, kept: pads.Dataset | None) -> Salvaged:
        """Choose the rows that the table lacks, each identity once."""
        keys, lacked = self._keys, "offered"
        if kept is not None:
            self._connection.register("kept", kept)
            lacked = f"(SELECT * FROM offered ANTI JOIN kept USING ({keys}))"
        self._connection.execute(f"CREATE TABLE lacked AS SELECT * FROM {lacked}")
        self._connection.execute(
            f"CREATE TABLE chosen AS SELECT {keys}, min((source, position)) AS place "
            f"FROM lacked WHERE sound GROUP BY {keys}"
        )
        ((rows, refused),) = self._connection.execute(
            "SELECT (SELECT count(*) FROM chosen), (SELECT count(*) FROM "
            f"(SELECT {keys} FROM lacked WHERE NOT sound) ANTI JOIN chosen USING ({keys}))"
        ).fetchall()
        return Salvaged(int(rows), int(refused))

    def chosen(self, source: int) -> np.ndarray:
        """Positions of the chosen rows of a file."""
        found = self._connection.sql(
            f"SELECT place[2] AS position FROM chosen WHERE place[1] = {int(source)} ORDER BY 1"
        )
        return np.asarray(found.fetchnumpy()["position"])
