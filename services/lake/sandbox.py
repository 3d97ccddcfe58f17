"""DuckDB that sees the tables it is given and nothing else: no other file, no network, no Python.

A statement is looked through before it is run (:mod:`services.lake.guard`), and what it may do does
not hang on that alone: DuckDB is locked so that it can open the tables' own files, and no others.
"""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TypeAlias

import duckdb
import pyarrow as pa
import pyarrow.dataset as pads

from services.errors import LakeError
from services.lake.guard import NO_FILES, Reading, require_reading
from services.lake.schemas import MADE_BY
from services.lake.views import VIEWS
from services.objects.faults import Fault, fault, plain

SHUT = (
    "TimeZone = 'UTC'",
    "temp_directory = ''",
    "autoinstall_known_extensions = false",
    "autoload_known_extensions = false",
    # Otherwise a table name that is not found is looked for among Python's variables.
    "python_enable_replacements = false",
    "enable_external_access = false",
    "lock_configuration = true",
)


@dataclass(frozen=True)
class Files:
    """The data files of a table's version, which DuckDB reads by itself.

    Attributes:
        paths: Absolute paths.
        columns: The table's columns; every file has them all.
    """

    paths: tuple[str, ...]
    columns: tuple[str, ...]


Source: TypeAlias = Files | pads.Dataset
"""Where the rows of a table come from."""


@contextmanager
def evaluated(sources: Mapping[str, Source], sql: str) -> Iterator[duckdb.DuckDBPyRelation]:
    """The result of one reading statement, valid inside the ``with`` block.

    Only the tables that it names are opened.

    Raises:
        LakeError: The statement is wrong, not allowed, or names what is not there; or a file of a
            table is damaged.
    """
    offered: dict[str, Source] = {}
    with duckdb.connect(":memory:") as connection:
        try:
            reading = require_reading(connection, sql)
            _offer(connection, sources, reading, offered)
            for setting in SHUT:
                connection.execute(f"SET {setting}")
            yield connection.sql(sql)
        except RuntimeError as error:
            if "interrupted" in str(error).lower():  # DuckDB's own answer to Ctrl-C
                raise KeyboardInterrupt from error
            raise
        except (duckdb.Error, pa.ArrowException, UnicodeDecodeError) as error:
            says = _damage(error, offered) or f"query: {explained(str(error), sorted(sources))}"
            raise LakeError(says) from error


def _offer(
    connection: duckdb.DuckDBPyConnection,
    sources: Mapping[str, Source],
    reading: Reading,
    tables: dict[str, Source],
) -> None:
    """Make the tables and views known that a statement asks for, and put them into ``tables``."""
    names = {name.lower() for name in reading.names}
    views = {name for name in VIEWS if name in names}
    needed = names | {table for name in views for table in VIEWS[name].tables}
    asked = list(sources) if reading.lists else sorted(needed)
    tables.update((name, sources[name]) for name in asked if name in sources)
    paths = [
        path for source in tables.values() if isinstance(source, Files) for path in source.paths
    ]
    if paths:
        connection.execute(f"SET allowed_paths = [{', '.join(map(_quoted, paths))}]")
    for name, source in tables.items():
        if isinstance(source, Files):
            connection.execute(f'CREATE VIEW "{name}" AS {_select(source)}')
        else:
            connection.register(name, source)
    for name in VIEWS:
        view = VIEWS[name]
        if (reading.lists or name in views) and all(table in tables for table in view.tables):
            connection.execute(f'CREATE VIEW "{name}" AS {view.sql}')
        elif name in views:
            raise LakeError(absent(next(table for table in view.tables if table not in tables)))


def _select(source: Files) -> str:
    columns = ", ".join(f'"{name}"' for name in source.columns)
    paths = ", ".join(map(_quoted, source.paths))
    return f"SELECT {columns} FROM read_parquet([{paths}])"


def _quoted(text: str) -> str:
    return "'" + text.replace("'", "''") + "'"


def _damage(error: Exception, tables: Mapping[str, Source]) -> str:
    """What to say if an error comes of a table's files and not of the statement; else nothing."""
    text = str(error)
    concerned = [name for name, source in tables.items() if _names(text, name, source)]
    # What DuckDB's Parquet reader stumbles over is of no class of its own, or names no file.
    if type(error) in (duckdb.Error, duckdb.IOException, UnicodeDecodeError) and not concerned:
        concerned = list(tables)
    if not concerned:
        return ""
    cause = plain(error).partition(" LINE 1: ")[0]
    meant = Fault(cause, "look what is wrong with `lmtr lake check`")
    if any(not isinstance(tables[name], Files) for name in concerned):
        meant = fault(error) or meant  # of an object store
    which = " or ".join(map(repr, concerned))
    return f"table {which} cannot be read: {meant.cause}; {meant.mend}"


def _names(text: str, table: str, source: Source) -> bool:
    """Whether a message names a table's files, or its rows as Arrow could not read them."""
    if isinstance(source, Files):
        return any(path in text for path in source.paths)
    return f"registered as '{table}' failed" in text


def explained(message: str, tables: list[str]) -> str:
    """DuckDB's message in one line, with the tables of the lake where it misses one."""
    text = message.partition("\n\nLINE")[0]
    if "disabled by configuration" in text:
        return NO_FILES
    missing = re.search(r"Table with name (\S+) does not exist", text)
    if missing is None:
        return f"{' '.join(text.split())}; correct the statement"
    name = missing[1]
    if name in MADE_BY:
        return absent(name)
    near = get_close_matches(name, [*tables, *VIEWS], n=1)
    hint = f"did you mean {near[0]!r}? " if near else ""
    return f"no table is called {name!r}; {hint}there are: {', '.join(tables) or 'none yet'}"


def absent(table: str) -> str:
    """What to say of a table that has not been made."""
    return f"table {table!r} is not there yet: make it with `{MADE_BY[table]}`"
