"""Rows of a data file against what their table must be: nulls, finite numbers, rules, digests.

Rows come a batch at a time, so memory does not grow with the file.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.fs as pafs
import pyarrow.parquet as pq

from services.lake.digest import COLUMN, has_digest, row_digests
from services.lake.rules import MAY_BE_NAN, RULES
from services.lake.schemas import IDENTITY, SCHEMAS

BATCH_BYTES = 32_000_000
"""Size of the batches that a file is read in, as far as its footer tells."""

MOST_ROWS = 8192


@dataclass
class Broken:
    """Rows that break one thing.

    Attributes:
        kind: ``null``, ``finite``, ``length``, ``range`` or ``digest``.
        says: What must hold.
        rows: Positions in the batch.
    """

    kind: str
    says: str
    rows: np.ndarray


@dataclass
class Examined:
    """What was found in one batch.

    Attributes:
        broken: Rows by what they break.
        undigested: Positions of rows without a digest.
    """

    broken: list[Broken] = field(default_factory=list)
    undigested: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))


def read_schema(table: str) -> pa.Schema:
    """The schema that whatever lies in a file can be read as, so that rows can be judged."""
    return pa.schema([_lenient(each) for each in SCHEMAS[table]])


def file_batches(files: pafs.FileSystem, path: str, table: str) -> Iterator[pa.Table]:
    """The rows of a data file; columns of later schema versions are null.

    Raises:
        pyarrow.ArrowException, OSError: The file is damaged; batches before the damage came out.
    """
    schema = read_schema(table)
    with files.open_input_file(path) as handle:
        file = pq.ParquetFile(handle)
        for batch in file.iter_batches(_batch_rows(file.metadata)):
            rows = pa.Table.from_batches([batch])
            for each in schema:
                if each.name not in rows.column_names:
                    rows = rows.append_column(each, pa.nulls(len(rows), each.type))
            yield rows.select(schema.names).cast(schema)


def row_names(table: str, rows: pa.Table, positions: np.ndarray) -> list[str]:
    """Identities of rows, for people."""
    keys = rows.select(IDENTITY[table]).take(pa.array(positions)).to_pylist()
    return [named(key) for key in keys]


def named(key: dict[str, object]) -> str:
    """An identity for people."""
    return ", ".join(f"{name}={value}" for name, value in key.items())


class Examiner:
    """Judges batches of rows of one table."""

    def __init__(self, table: str) -> None:
        self._table = table
        self._rules = RULES[table]
        self._connection = duckdb.connect(":memory:")

    def __enter__(self) -> "Examiner":
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()

    def examine(self, rows: pa.Table) -> Examined:
        """Everything that a batch breaks."""
        examined = Examined([*self._nulls(rows), *self._unfinite(rows), *self._rule_breaks(rows)])
        if has_digest(self._table):
            self._digests(rows, examined)
        return examined

    def _nulls(self, rows: pa.Table) -> Iterator[Broken]:
        for each in SCHEMAS[self._table]:
            if not each.nullable and rows[each.name].null_count:
                positions = _where(pc.is_null(rows[each.name]))
                yield Broken("null", f"{each.name} has a value", positions)

    def _unfinite(self, rows: pa.Table) -> Iterator[Broken]:
        for name in rows.column_names:
            if name not in MAY_BE_NAN.get(self._table, {}):
                positions = _unfinite_rows(rows[name].combine_chunks())
                if len(positions):
                    yield Broken("finite", f"{name} is finite", positions)

    def _rule_breaks(self, rows: pa.Table) -> Iterator[Broken]:
        if not self._rules:
            return
        numbered = rows.append_column("row number", pa.array(np.arange(len(rows))))
        self._connection.register("batch", numbered)
        breaks = [f"NOT coalesce({rule.holds}, true)" for rule in self._rules]
        counts = ", ".join(f"count(*) FILTER ({broken})" for broken in breaks)
        (found,) = self._connection.execute(f"SELECT {counts} FROM batch").fetchall()
        for rule, broken, count in zip(self._rules, breaks, found, strict=True):
            if count:
                result = self._connection.execute(
                    f'SELECT "row number" FROM batch WHERE {broken} ORDER BY ALL'
                )
                positions = np.array([row for (row,) in result.fetchall()], dtype=np.int64)
                yield Broken(rule.kind, rule.says, positions)
        self._connection.unregister("batch")

    def _digests(self, rows: pa.Table, examined: Examined) -> None:
        examined.undigested = _where(pc.is_null(rows[COLUMN]))
        if len(examined.undigested) == len(rows):
            return
        differs = pc.not_equal(rows[COLUMN], pa.array(row_digests(self._table, rows)))
        positions = _where(pc.fill_null(differs, False))
        if len(positions):
            examined.broken.append(Broken("digest", "its numbers have its digest", positions))


def _lenient(each: pa.Field) -> pa.Field:
    """A column that may be null, and lists that may be of any length."""
    kind = each.type
    if pa.types.is_fixed_size_list(kind):
        kind = pa.list_(kind.value_type)
    return pa.field(each.name, kind)


def _batch_rows(metadata: pq.FileMetaData) -> int:
    groups = (metadata.row_group(k).total_byte_size for k in range(metadata.num_row_groups))
    row_bytes = max(1, sum(groups) // max(1, metadata.num_rows))
    return int(max(1, min(MOST_ROWS, BATCH_BYTES // row_bytes)))


def _where(mask: pa.ChunkedArray) -> np.ndarray:
    return np.flatnonzero(mask.to_numpy())


def _unfinite_rows(column: pa.Array) -> np.ndarray:
    """Positions of rows that hold NaN or infinity, or a null inside a list."""
    kind = column.type
    if pa.types.is_map(kind):
        column = column.cast(pa.list_(pa.struct([("k", kind.key_type), ("v", kind.item_type)])))
        values, parents = pc.list_flatten(column).field("v"), pc.list_parent_indices(column)
    elif pa.types.is_list(kind):
        values, parents = pc.list_flatten(column), pc.list_parent_indices(column)
    else:
        values, parents = column, None
    if not pa.types.is_floating(values.type):
        return np.empty(0, dtype=np.int64)
    # A null of its own is another finding; one inside a list is a hole.
    finite = pc.fill_null(pc.is_finite(values), parents is None)
    bad = np.flatnonzero(~finite.to_numpy(zero_copy_only=False))
    return bad if parents is None else np.unique(parents.to_numpy()[bad])
