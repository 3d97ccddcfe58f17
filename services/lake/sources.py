"""Where a query finds the rows of each table: its files for DuckDB, or an Arrow data set."""

from collections.abc import Iterator, Mapping
from pathlib import Path

from deltalake import DeltaTable

from services.lake.delta import FIRST_VERSION_KEY, DeltaTables
from services.lake.inside import paths_of, require_inside
from services.lake.log import entry_path
from services.lake.sandbox import Files, Source
from services.lake.schemas import SCHEMAS, version_of


class Recent:
    """Present versions of tables, kept open: a log of many commits is read once and then followed.

    Args:
        tables: The tables.
    """

    def __init__(self, tables: DeltaTables) -> None:
        self._tables = tables
        self._open: dict[str, tuple[DeltaTable, tuple[int, int]]] = {}

    def table(self, name: str) -> DeltaTable:
        """The table in its present version; the caller must not commit to it.

        Raises:
            LakeError: It is missing or cannot be read.
        """
        delta, known = self._open.pop(name, (None, None))
        if delta is None or known is None or known != self._head(name, delta):
            delta = self._tables.delta(name)
        elif self._entry(name, delta.version() + 1).exists():
            self._tables.refresh(name, delta)
        head = self._head(name, delta)
        if head is not None:
            self._open[name] = delta, head
        return delta

    def _head(self, name: str, delta: DeltaTable) -> tuple[int, int] | None:
        """What tells the newest known entry of a log from another under its name.

        A repair takes entries away, and a table may be made anew: following such a log on from
        where it was would read what is gone. None in an object store, where asking costs as much
        as opening.
        """
        if self._tables.storage.is_remote:
            return None
        try:
            found = self._entry(name, delta.version()).stat()
        except OSError:
            return None
        return found.st_ino, found.st_mtime_ns

    def _entry(self, name: str, version: int) -> Path:
        return self._tables.storage.folder / name / entry_path(version)


class Sources(Mapping[str, Source]):
    """Tables of a lake by name; each is opened when it is asked for.

    Args:
        tables: The tables.
        recent: Their present versions.
        versions: Versions of tables; the present ones by default.
    """

    def __init__(self, tables: DeltaTables, recent: Recent, versions: Mapping[str, int]) -> None:
        self._tables = tables
        self._recent = recent
        self._versions = versions

    def __getitem__(self, table: str) -> Source:
        version = self._versions.get(table)
        if version is None:
            return source_of(self._tables, table, self._recent.table(table))
        return source_of(self._tables, table, self._tables.delta(table, version))

    def __contains__(self, table: object) -> bool:
        return isinstance(table, str) and table in SCHEMAS and self._tables.exists(table)

    def __iter__(self) -> Iterator[str]:
        return iter(self._tables.tables())

    def __len__(self) -> int:
        return len(self._tables.tables())


def source_of(tables: DeltaTables, table: str, delta: DeltaTable) -> Source:
    """Where the rows of an opened table are.

    DuckDB reads a folder's files by itself, as long as all have the same columns; else Arrow does.
    """
    schema = SCHEMAS[table]
    made_as = delta.metadata().configuration.get(FIRST_VERSION_KEY)
    if made_as == version_of(schema) and not tables.storage.is_remote:
        paths = paths_of(delta)
        if paths:
            require_inside(table, tables.storage.folder / table, paths)
            return Files(paths, tuple(schema.names))
    return tables.dataset(table, delta)
