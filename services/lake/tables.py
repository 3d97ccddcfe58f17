"""Tables of the lake: idempotent appends, reads of any version (Delta Lake through delta-rs)."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeAlias
from urllib.parse import unquote

import duckdb
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset as pads
from deltalake import CommitProperties, DeltaTable, Transaction, write_deltalake
from deltalake.exceptions import CommitFailedError, DeltaError, TableNotFoundError

from services.errors import LakeError
from services.lake.checks import conform
from services.lake.exclusive import lock_of, rewriting
from services.lake.sandbox import Files, Source, absent, evaluated
from services.lake.schemas import SCHEMAS, older_versions, version_of
from services.lake.storage import Storage
from services.objects.faults import Fault, fault, plain

COMMIT_RETRIES = 50
"""How often delta-rs itself tries a commit that another writer was quicker with."""

CONFLICT_RETRIES = 20
"""How often an append begins anew when another writer made the table or took the transaction."""

VERSION_KEY = "lmtr.schemaVersion"

FIRST_VERSION_KEY = "lmtr.firstSchemaVersion"
"""Version of the schema that a table was made with: files of that time lack later columns."""

KEEP_LOG = {"delta.enableExpiredLogCleanup": "false"}
"""Delta drops old versions after 30 days; a model must find its data for good."""

BATCH_ROWS = 256

SCANNED_ROWS = 16_384

Value: TypeAlias = Any
"""A value out of a query: its statement decides the type."""


class Lake:
    """The tables at one place; made when they are first appended to.

    Appends are atomic and idempotent: every batch is a transaction ``(app_id, number)`` of its
    table, whole or not there at all, and never there twice.

    Attributes:
        storage: Where the tables lie.
    """

    def __init__(self, place: Path | str | Storage) -> None:
        self.storage = Storage.at(place)

    def tables(self) -> list[str]:
        """Names of the tables that are there."""
        return [name for name in SCHEMAS if self.exists(name)]

    def exists(self, table: str) -> bool:
        """Whether a table is there."""
        try:
            return DeltaTable.is_deltatable(self.uri(table), self._options)
        except OSError as error:  # of an object store
            raise self._unreadable(table, error) from error

    def version(self, table: str) -> int:
        """Present version of a table; every append raises it."""
        return self.delta(table).version()

    def history(self, table: str) -> list[dict[str, Any]]:
        """The commits of a table, newest first."""
        return self.delta(table).history()

    def last_transaction(self, table: str, app_id: str) -> int | None:
        """Number of the last transaction of ``app_id``, or None before its first."""
        return self.delta(table).transaction_version(app_id) if self.exists(table) else None

    def append(self, table: str, rows: pa.Table, *, app_id: str, number: int) -> bool:
        """Append a batch as transaction ``number`` of ``app_id``.

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
        for _ in range(CONFLICT_RETRIES):
            with suppress(CommitFailedError):
                return self._append_once(table, checked, transaction)
        raise LakeError(
            f"table {table!r}: {CONFLICT_RETRIES} appends in a row lost against other writers of "
            f"{app_id!r}; let one process at a time append under that name"
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
        dataset = _dataset(opened or self.delta(table), SCHEMAS[table])
        try:
            yield from dataset.to_batches(
                columns=names, filter=only, batch_size=SCANNED_ROWS, batch_readahead=4
            )
        except (pa.ArrowException, OSError) as error:
            raise self._unreadable(table, error) from error

    def values(self, table: str, column: str, where: str | None = None) -> list[Any]:
        """The values of one column; none from a table that is not there yet."""
        if not self.exists(table):
            return []
        return list(self.read(table, [column], where)[column].to_pylist())

    def append_rows(
        self, table: str, rows: Sequence[Mapping[str, Any]], *, app_id: str, number: int = 1
    ) -> bool:
        """Append rows given as dictionaries, see :meth:`append`; missing columns are null."""
        return self.append(
            table,
            pa.Table.from_pylist(list(rows), schema=SCHEMAS[table]),
            app_id=app_id,
            number=number,
        )

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
        return _Sources(self, versions or {})

    def source(self, table: str, version: int | None = None) -> Source:
        """Where DuckDB finds the rows of a table.

        It reads a folder's files by itself, as long as all have the same columns; else Arrow does.
        """
        delta, schema = self.delta(table, version), SCHEMAS[table]
        made_as = delta.metadata().configuration.get(FIRST_VERSION_KEY)
        if made_as == version_of(schema) and not self.storage.is_remote:
            paths = tuple(map(_path, delta.file_uris()))
            if paths:
                return Files(paths, tuple(schema.names))
        return _dataset(delta, schema)

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
            try:
                done = self.delta(table).delete(where, commit_properties=_retried())
            except (DeltaError, OSError) as error:
                raise self._unwritable(table, error) from error
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
                delta.optimize.compact(commit_properties=_retried())
                delta.create_checkpoint()
            except (DeltaError, OSError) as error:
                raise self._unwritable(table, error) from error
        return True

    def _append_once(self, table: str, rows: pa.Table, transaction: Transaction) -> bool:
        delta = self.open_or_create(table)
        done = delta.transaction_version(transaction.app_id)
        if done is not None and done >= transaction.version:
            return False
        self.commit(table, delta, rows, transaction)
        return True

    def uri(self, table: str) -> str:
        """Path or address of a table.

        Raises:
            LakeError: No table has that name.
        """
        if table not in SCHEMAS:
            raise LakeError(f"lake: no table is called {table!r}; choose of {', '.join(SCHEMAS)}")
        return self.storage.table(table)

    @property
    def _options(self) -> dict[str, str] | None:
        return dict(self.storage.options) or None

    def delta(self, table: str, version: int | None = None) -> DeltaTable:
        """The table as delta-rs has it, in its present or an earlier version.

        Raises:
            LakeError: The table or the version is missing, cannot be read, or is of a schema that
                this LMTR does not know.
        """
        delta = self.opened(table)
        _require_known(table, delta)
        latest = delta.version()
        if version is not None and not 0 <= version <= latest:
            raise LakeError(
                f"table {table!r} has no version {version}; choose one of 0 to {latest}"
            )
        return delta if version is None else self.opened(table, version)

    def opened(self, table: str, version: int | None = None) -> DeltaTable:
        """The table as delta-rs has it, of whatever schema.

        Raises:
            LakeError: The table or the version is missing, or cannot be read.
        """
        try:
            return DeltaTable(self.uri(table), version, storage_options=self._options)
        except TableNotFoundError as error:
            raise LakeError(absent(table)) from error
        except (DeltaError, OSError) as error:
            raise self._unreadable(table, error) from error

    def open_or_create(self, table: str) -> DeltaTable:
        """The table as delta-rs has it, made if it is not there.

        Raises:
            LakeError: It cannot be made or opened.
        """
        self.storage.require_safe_commits()
        try:
            for _ in range(CONFLICT_RETRIES):
                with suppress(CommitFailedError):  # another process makes it
                    return self._made(table)
            return self.delta(table)
        except (DeltaError, OSError) as error:
            raise self._unwritable(table, error) from error

    def refresh(self, table: str, delta: DeltaTable) -> None:
        """Bring an opened table to its present version.

        Raises:
            LakeError: It cannot be read any more.
        """
        try:
            delta.update_incremental()
        except (DeltaError, OSError) as error:
            raise self._unreadable(table, error) from error

    def commit(
        self,
        table: str,
        delta: DeltaTable,
        rows: pa.Table,
        transaction: Transaction,
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        """Append rows as a transaction to an opened table, which moves on to the new version.

        Raises:
            CommitFailedError: Another writer has used the transaction's name since the table was
                opened.
            LakeError: The table cannot be written.
        """
        properties = CommitProperties(
            custom_metadata=dict(metadata or {}),
            max_commit_retries=COMMIT_RETRIES,
            app_transactions=[transaction],
        )
        try:
            write_deltalake(delta, rows, mode="append", commit_properties=properties)
        except CommitFailedError:
            raise
        except (DeltaError, OSError) as error:
            raise self._unwritable(table, error) from error

    def _made(self, table: str) -> DeltaTable:
        if not self.exists(table):
            schema = SCHEMAS[table]
            if not self.storage.is_remote:
                (self.storage.folder / table).mkdir(parents=True, exist_ok=True)
            DeltaTable.create(
                self.uri(table),
                schema,
                mode="ignore",
                name=table,
                configuration={
                    VERSION_KEY: version_of(schema),
                    FIRST_VERSION_KEY: version_of(schema),
                    **KEEP_LOG,
                },
                storage_options=self._options,
                raise_if_key_not_exists=False,
            )
        return self.delta(table)

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

    def _unreadable(self, table: str, error: Exception) -> LakeError:
        cause, mend = self._fault(error, "look what is wrong with `lmtr lake check`")
        return LakeError(f"table {table!r} cannot be read: {cause}; {mend}")

    def _unwritable(self, table: str, error: Exception) -> LakeError:
        cause, mend = self._fault(error, f"check space and permissions of {self.uri(table)}")
        return LakeError(f"table {table!r} cannot be written: {cause}; {mend}")

    def _fault(self, error: Exception, mend: str) -> Fault:
        """What an error means: a store's own faults, or else its words."""
        known = fault(error) if self.storage.is_remote else None
        return known or Fault(plain(error), mend)


def _retried() -> CommitProperties:
    return CommitProperties(max_commit_retries=COMMIT_RETRIES)


class _Sources(Mapping[str, Source]):
    """Tables of a lake by name; each is opened when it is asked for."""

    def __init__(self, lake: Lake, versions: Mapping[str, int]) -> None:
        self._lake = lake
        self._versions = versions

    def __getitem__(self, table: str) -> Source:
        return self._lake.source(table, self._versions.get(table))

    def __iter__(self) -> Iterator[str]:
        return iter(self._lake.tables())

    def __len__(self) -> int:
        return len(self._lake.tables())


def _dataset(delta: DeltaTable, schema: pa.Schema) -> pads.Dataset:
    """An opened table as an Arrow data set; columns that were added later read as null."""
    dataset = delta.to_pyarrow_dataset()
    added = [field for field in schema if dataset.schema.get_field_index(field.name) < 0]
    return dataset.replace_schema(pa.schema([*dataset.schema, *added])) if added else dataset


def _path(uri: str) -> str:
    """The path that delta-rs names by a URI of its own."""
    return unquote(uri.removeprefix("file://"))


def _require_known(table: str, delta: DeltaTable) -> None:
    """Refuse a table whose columns are not those of this LMTR's schema."""
    found, known = delta.metadata().configuration.get(VERSION_KEY), version_of(SCHEMAS[table])
    if found in older_versions(table):
        raise LakeError(
            f"table {table!r} is of schema version {found}, this LMTR works with version {known}; "
            "bring it up to date with `lmtr lake migrate`"
        )
    columns = {field.name for field in delta.schema().fields}
    differing = sorted(columns.symmetric_difference(SCHEMAS[table].names))
    if found != known or differing:
        about = f" and differs in {', '.join(differing)}" if differing else ""
        raise LakeError(
            f"table {table!r} is of schema version {found}{about}, this LMTR knows version "
            f"{known}; use the LMTR that made it, or another home"
        )


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
