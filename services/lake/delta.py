"""Tables of a lake as delta-rs has them: opened, made, committed to, with clear errors."""

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import pyarrow as pa
import pyarrow.dataset as pads
import pyarrow.fs as pafs
from deltalake import CommitProperties, DeltaTable, Transaction, write_deltalake
from deltalake.exceptions import CommitFailedError, DeltaError, TableNotFoundError
from deltalake.fs import DeltaStorageHandler

from services.errors import LakeError, LostVersionError
from services.lake.durable import make_durable
from services.lake.inside import paths_of, require_inside
from services.lake.log import entry_path, read_log
from services.lake.sandbox import absent
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

LOST = "lmtr.lostVersion"
"""Note of a commit that holds nothing and only takes the number of a version that was lost."""

KEEP_LOG = {"delta.enableExpiredLogCleanup": "false"}
"""Delta drops old versions after 30 days; a model must find its data for good."""


class DeltaTables:
    """The tables at one place.

    Attributes:
        storage: Where they lie.
    """

    def __init__(self, storage: Storage) -> None:
        self.storage = storage
        self._durable: dict[str, int] = {}

    def tables(self) -> list[str]:
        """Names of the tables that are there."""
        return [name for name in SCHEMAS if self.exists(name)]

    def exists(self, table: str) -> bool:
        """Whether a table is there."""
        try:
            return DeltaTable.is_deltatable(self.uri(table), self._options)
        except OSError as error:  # of an object store
            raise self.unreadable(table, error) from error

    def version(self, table: str) -> int:
        """Present version of a table; every append raises it."""
        return self.delta(table).version()

    def history(self, table: str) -> list[dict[str, Any]]:
        """The commits of a table, newest first."""
        return self.delta(table).history()

    def last_transaction(self, table: str, app_id: str) -> int | None:
        """Number of the last transaction of ``app_id``, or None before its first."""
        return self.delta(table).transaction_version(app_id) if self.exists(table) else None

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

    def files(self, table: str) -> pafs.FileSystem:
        """The files of a table, on whatever storage; paths are relative to the table."""
        return pafs.PyFileSystem(DeltaStorageHandler(self.uri(table), self._options))

    def scanned_files(self, table: str) -> pafs.FileSystem:
        """The same to scan rows from.

        Those of a folder are Arrow's own: it may let go of a file in a thread of its own after the
        interpreter has ended, which is an abort where Python holds the file.
        """
        if self.storage.is_remote:
            return self.files(table)
        return pafs.SubTreeFileSystem(str(self.storage.folder / table), pafs.LocalFileSystem())

    def dataset(self, table: str, opened: DeltaTable) -> pads.Dataset:
        """An opened table as an Arrow data set; columns that were added later read as null."""
        if not self.storage.is_remote:
            require_inside(table, self.storage.folder / table, paths_of(opened))
        dataset = opened.to_pyarrow_dataset(filesystem=self.scanned_files(table))
        names = dataset.schema.names
        added = [field for field in SCHEMAS[table] if field.name not in names]
        return dataset.replace_schema(pa.schema([*dataset.schema, *added])) if added else dataset

    def delta(self, table: str, version: int | None = None) -> DeltaTable:
        """The table as delta-rs has it, in its present or an earlier version.

        Raises:
            LostVersionError: A repair had to take the version out of the log.
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
        return delta if version is None else self._pinned(table, version)

    def _pinned(self, table: str, version: int) -> DeltaTable:
        """A version that was named; never another one that came under its number."""
        if self._is_marked_lost(table, version):
            raise _lost(table, version)
        try:
            return self.opened(table, version)
        except LakeError as error:
            if not read_log(self.files(table)).reaches(version):
                raise _lost(table, version) from error
            raise

    def _is_marked_lost(self, table: str, version: int) -> bool:
        try:
            with self.files(table).open_input_file(entry_path(version)) as file:
                # Inside of strings JSON escapes quotes, so that this is a key.
                return f'"{LOST}":'.encode() in file.read()
        except FileNotFoundError:  # a checkpoint stands for it, or it cannot be opened
            return False
        except OSError as error:
            raise self.unreadable(table, error) from error

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
            raise self.unreadable(table, error) from error

    def open_or_create(self, table: str, notes: Mapping[str, str] | None = None) -> DeltaTable:
        """The table as delta-rs has it, made if it is not there.

        Args:
            table: Name of the table.
            notes: What the history shall say of its making.

        Raises:
            LakeError: It cannot be made or opened.
        """
        self.storage.require_safe_commits()
        try:
            for _ in range(CONFLICT_RETRIES):
                with suppress(CommitFailedError):  # another process makes it
                    return self._made(table, notes or {})
            return self.delta(table)
        except (DeltaError, OSError) as error:
            raise self.unwritable(table, error) from error

    def refresh(self, table: str, delta: DeltaTable) -> None:
        """Bring an opened table to its present version.

        Raises:
            LakeError: It cannot be read any more.
        """
        try:
            delta.update_incremental()
        except (DeltaError, OSError) as error:
            raise self.unreadable(table, error) from error

    def commit(
        self,
        table: str,
        delta: DeltaTable,
        rows: pa.Table,
        transaction: Transaction,
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        """Append rows as a transaction to an opened table, which moves on to the new version.

        On a disk of this machine the rows outlast a power cut from then on.

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
            raise self.unwritable(table, error) from error
        self.settle(table, delta)

    def settle(self, table: str, delta: DeltaTable) -> None:
        """Make the version that an opened table is at outlast a power cut; a store does so itself.

        Raises:
            LakeError: The disk refuses, and whether the version is there to stay is not known.
        """
        if self.storage.is_remote:
            return
        version = delta.version()
        try:
            make_durable(self.storage.folder / table, version, self._durable.get(table))
        except (OSError, ValueError) as error:
            raise self.unwritable(table, error) from error
        self._durable[table] = version

    def _made(self, table: str, notes: Mapping[str, str]) -> DeltaTable:
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
                commit_properties=CommitProperties(custom_metadata=dict(notes)),
            )
        return self.delta(table)

    def unreadable(self, table: str, error: Exception) -> LakeError:
        """What to raise when delta-rs or Arrow cannot read a table."""
        cause, mend = self._fault(error, "look what is wrong with `lmtr lake check`")
        return LakeError(f"table {table!r} cannot be read: {cause}; {mend}")

    def unwritable(self, table: str, error: Exception) -> LakeError:
        """What to raise when a table cannot be changed."""
        cause, mend = self._fault(error, f"check space and permissions of {self.uri(table)}")
        return LakeError(f"table {table!r} cannot be written: {cause}; {mend}")

    def _fault(self, error: Exception, mend: str) -> Fault:
        """What an error means: a store's own faults, or else its words."""
        known = fault(error) if self.storage.is_remote else None
        return known or Fault(plain(error), mend)


def retried() -> CommitProperties:
    """Settings of a commit that tries again when another writer was quicker."""
    return CommitProperties(max_commit_retries=COMMIT_RETRIES)


def commit_nothing(delta: DeltaTable, notes: Mapping[str, str]) -> None:
    """Add a version that only has notes; the opened table stays where it was.

    Raises:
        DeltaError, OSError: The table cannot be written, or another writer was quicker.
    """
    properties = CommitProperties(custom_metadata=dict(notes), max_commit_retries=0)
    delta.create_write_transaction([], "append", delta.schema(), commit_properties=properties)


def _lost(table: str, version: int) -> LostVersionError:
    return LostVersionError(
        f"table {table!r}: version {version} is lost: its log was damaged there, and a repair set "
        "the entry aside; choose another version, or make anew what was made from it"
    )


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
