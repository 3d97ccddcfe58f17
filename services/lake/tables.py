"""Tables of the lake: idempotent appends, reads of any version (Delta Lake through delta-rs)."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeAlias

import duckdb
import pyarrow as pa
import pyarrow.compute as pc
from deltalake import DeltaTable, Transaction
from deltalake.exceptions import CommitFailedError, DeltaError

from services.errors import LakeError
from services.lake.checks import conform
from services.lake.delta import CONFLICT_RETRIES, DeltaTables, retried
from services.lake.exclusive import lock_of, rewriting
from services.lake.identity import lacking
from services.lake.sandbox import Source, absent, evaluated
from services.lake.schemas import SCHEMAS
from services.lake.sources import Recent, Sources
from services.lake.storage import Storage

BATCH_ROWS = 256

SCANNED_ROWS = 16_384

Value: TypeAlias = Any
"""A value out of a query: its statement decides the type."""


class Lake(DeltaTables):
    """The tables at one place; made when they are first appended to.

    Appends are atomic and idempotent: every batch is a transaction ``(app_id, number)`` of its
    table, whole or not there at all, and never there twice; rows of :meth:`append_rows` are
    compared with the table's own besides.

    Attributes:
        storage: Where the tables lie.
    """

    def __init__(self, place: Path | str | Storage) -> None:
        super().__init__(Storage.at(place))
        self._recent = Recent(self)

    def append(self, table: str, rows: pa.Table, *, app_id: str, number: int) -> bool:
        """Append a batch as transaction ``number`` of ``app_id``; its rows are not looked at.

        A table that lost its log in part remembers fewer transactions: rows that may be in already
        are for :meth:`append_rows` and :class:`~services.lake.appender.Appender`.

        Args:
            table: Name of the table.
            rows: The batch, of the table's schema.
            app_id: Who appends; numbers count for each alone.
            number: Must grow from batch to batch.

        Returns:
            Whether the rows were appended; False if this transaction is in already.

        Raises:
            LakeError: The rows break the schema, or the table cannot be written.
        """
        checked, transaction = conform(table, rows), Transaction(app_id, number)
        return self._insisting(
            table, app_id, lambda: self._append_once(table, checked, transaction)
        )

    def read(
        self,
        table: str,
        columns: Sequence[str] | None = None,
        where: str | None = None,
        version: int | None = None,
        order_by: str | None = None,
        limit: int | None = None,
    ) -> pa.Table:
        """Rows of a table, of the schema's types.

        Args:
            table: Name of the table.
            columns: Which columns; all by default.
            where: Condition in SQL.
            version: Version of the table; the present one by default.
            order_by: Expressions in SQL; without them the order is not defined.
            limit: At most so many rows.

        Raises:
            LakeError: The table, version or a column is missing, or the SQL is wrong.
        """
        with self._selected(table, columns, where, version, order_by, limit) as (relation, schema):
            return relation.to_arrow_table().cast(schema)

    def batches(
        self,
        table: str,
        columns: Sequence[str] | None = None,
        where: str | None = None,
        version: int | None = None,
        order_by: str | None = None,
        limit: int | None = None,
    ) -> Iterator[pa.Table]:
        """The same a few rows at a time, for tables that are larger than the memory."""
        with self._selected(table, columns, where, version, order_by, limit) as (relation, schema):
            for batch in relation.to_arrow_reader(BATCH_ROWS):
                if batch.num_rows:
                    yield pa.Table.from_batches([batch]).cast(schema)

    def scan(
        self,
        table: str,
        columns: Sequence[str],
        only: pc.Expression | None = None,
        opened: DeltaTable | None = None,
    ) -> Iterator[pa.RecordBatch]:
        """Columns as they lie in the files, in the same order for the same opened table.

        It is the fast way to numbers that fill the memory: nothing is sorted or copied.

        Args:
            table: Name of the table.
            columns: Which columns.
            only: Which rows; all by default.
            opened: The table from :meth:`delta`; its present version by default.

        Raises:
            LakeError: The table or a column is missing, or a file is damaged.
        """
        names = self._chosen(table, columns).names
        dataset = self.dataset(table, opened or self.delta(table))
        try:
            for file in dataset.get_fragments(only):
                wanted = None if only is None else file.count_rows(filter=only)
                if wanted == 0:
                    continue
                # Where all rows are wanted there is nothing to look at, and nothing is copied.
                some = None if wanted == file.count_rows() else only
                yield from file.to_batches(
                    dataset.schema, columns=names, filter=some, batch_size=SCANNED_ROWS
                )
        except (pa.ArrowException, OSError) as error:
            raise self.unreadable(table, error) from error

    def values(self, table: str, column: str, where: str | None = None) -> list[Any]:
        """The values of one column; none from a table that is not there yet."""
        if not self.exists(table):
            return []
        return list(self.read(table, [column], where)[column].to_pylist())

    def append_rows(self, table: str, rows: Sequence[Mapping[str, Any]], *, app_id: str) -> bool:
        """Append rows given as dictionaries, those that the table lacks by their identity.

        Rows that a repair brought back, or that were lost and are made again, so end up there once,
        whatever transactions the table remembers. The transaction only keeps two writers apart.

        Args:
            table: Name of the table.
            rows: The rows; missing columns are null.
            app_id: Who appends; all who may append the same rows must use the same name.

        Returns:
            Whether any row was new.

        Raises:
            LakeError: The rows break the schema, or the table cannot be read or written.
        """
        checked = conform(table, pa.Table.from_pylist(list(rows), schema=SCHEMAS[table]))
        return self._insisting(table, app_id, lambda: self._append_new(table, checked, app_id))

    def next_number(self, table: str, app_id: str) -> int:
        """The number of the next transaction of an application that appends again and again."""
        return (self.last_transaction(table, app_id) or 0) + 1

    def query_value(self, sql: str) -> Value:
        """The first value of the first row of a query over all tables; None if there is no row."""
        with evaluated(self.sources(), sql) as relation:
            rows = relation.limit(1).fetchall()
        return rows[0][0] if rows else None

    def sources(self, versions: Mapping[str, int] | None = None) -> Mapping[str, Source]:
        """All tables that are there, by name, opened when they are asked for.

        Args:
            versions: Versions of tables; the present ones by default.
        """
        return Sources(self, self._recent, versions or {})

    def delete(self, table: str, where: str) -> int:
        """Take rows out of the present version of a table; returns how many they were.

        Earlier versions keep them.

        Raises:
            LakeError: The table cannot be written, or another process replaces its files.
        """
        if not self.exists(table):
            return 0
        with rewriting(self.storage, table) as alone:
            if not alone:
                raise LakeError(
                    f"table {table!r}: another process replaces its files; wait until it is done "
                    f"(its lock: {lock_of(self.storage, table)})"
                )
            delta = self.delta(table)
            try:
                done = delta.delete(where, commit_properties=retried())
            except (DeltaError, OSError) as error:
                raise self.unwritable(table, error) from error
            self.settle(table, delta)
        return int(done["num_deleted_rows"])

    def compact(self, table: str) -> bool:
        """Join the small files of many appends into few large ones.

        Old files stay, so that every version can still be read.

        Returns:
            Whether it was done; False if another process is at it.
        """
        delta = self.delta(table)
        with rewriting(self.storage, table) as alone:
            if not alone:
                return False
            try:
                self.refresh(table, delta)
                delta.optimize.compact(commit_properties=retried())
                delta.create_checkpoint()
            except (DeltaError, OSError) as error:
                raise self.unwritable(table, error) from error
            self.settle(table, delta)
        return True

    def _insisting(self, table: str, app_id: str, append: Callable[[], bool]) -> bool:
        """Append, anew as long as another writer takes the transaction."""
        for _ in range(CONFLICT_RETRIES):
            with suppress(CommitFailedError):
                return append()
        raise LakeError(
            f"table {table!r}: {CONFLICT_RETRIES} appends in a row lost against other writers of "
            f"{app_id!r}; let one process at a time append under that name"
        )

    def _append_new(self, table: str, rows: pa.Table, app_id: str) -> bool:
        delta = self.open_or_create(table)
        try:
            new = lacking(table, self.dataset(table, delta), rows)
        except duckdb.Error as error:
            raise self.unreadable(table, error) from error
        if not new.num_rows:
            return False
        number = (delta.transaction_version(app_id) or 0) + 1
        self.commit(table, delta, new, Transaction(app_id, number))
        return True

    def _append_once(self, table: str, rows: pa.Table, transaction: Transaction) -> bool:
        delta = self.open_or_create(table)
        done = delta.transaction_version(transaction.app_id)
        if done is not None and done >= transaction.version:
            return False
        self.commit(table, delta, rows, transaction)
        return True

    @contextmanager
    def _selected(
        self,
        table: str,
        columns: Sequence[str] | None,
        where: str | None,
        version: int | None,
        order_by: str | None,
        limit: int | None,
    ) -> Iterator[tuple[duckdb.DuckDBPyRelation, pa.Schema]]:
        """The chosen rows and the schema of the chosen columns, valid inside the block."""
        schema = self._chosen(table, columns)
        statement = _select(schema.names, table, where, order_by, limit)
        versions = {} if version is None else {table: version}
        if not self.exists(table):
            raise LakeError(absent(table))
        with evaluated(self.sources(versions), statement) as relation:
            yield relation, schema

    def _chosen(self, table: str, columns: Sequence[str] | None) -> pa.Schema:
        self.uri(table)
        schema = SCHEMAS[table]
        if columns is None:
            return schema
        unknown = [name for name in columns if name not in schema.names]
        if unknown:
            raise LakeError(
                f"table {table!r} has no column {unknown[0]!r}; choose of {', '.join(schema.names)}"
            )
        return pa.schema([schema.field(name) for name in columns])


def _select(
    columns: Sequence[str],
    table: str,
    where: str | None,
    order_by: str | None,
    limit: int | None,
) -> str:
    """A SELECT statement; each part on lines of its own, so that a comment ends with its part."""
    names = ", ".join(f'"{name}"' for name in columns)
    parts = [f'SELECT {names} FROM "{table}"']
    if where is not None:
        parts.append(f"WHERE (\n{where}\n)")
    if order_by is not None:
        parts.append(f"ORDER BY {order_by}")
    if limit is not None:
        parts.append(f"LIMIT {int(limit)}")
    return "\n".join(parts)
