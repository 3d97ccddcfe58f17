"""DuckDB that sees the tables it is given and nothing else: no file, no network, no Python.

The tables come in as Arrow data sets, so DuckDB itself needs no access to the disk and has none:
what a statement may do does not hang on how well its text was understood. (In DuckDB 2 a ``COPY``
inside a ``WITH`` clause parses as a ``SELECT``.)
"""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from difflib import get_close_matches

import duckdb
import pyarrow as pa
import pyarrow.dataset as pads

from services.errors import LakeError
from services.lake.schemas import MADE_BY

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

READING = (duckdb.StatementType.SELECT, duckdb.StatementType.EXPLAIN)
"""Kinds of statements that are run; DESCRIBE, SHOW, SUMMARIZE, FROM and VALUES are SELECTs."""


@contextmanager
def evaluated(views: Mapping[str, pads.Dataset], sql: str) -> Iterator[duckdb.DuckDBPyRelation]:
    """The result of one reading statement over ``views``, valid inside the ``with`` block.

    Raises:
        LakeError: The statement is wrong, not allowed, or names what is not there.
    """
    with duckdb.connect(":memory:") as connection:
        for name, dataset in views.items():
            connection.register(name, dataset)
        for setting in SHUT:
            connection.execute(f"SET {setting}")
        try:
            _require_one_reading(sql)
            relation = connection.sql(sql)
            yield relation
        except RuntimeError as error:
            if "interrupted" in str(error).lower():  # DuckDB's own answer to Ctrl-C
                raise KeyboardInterrupt from error
            raise
        except (duckdb.Error, pa.ArrowException) as error:
            raise LakeError(f"query: {explained(str(error), sorted(views))}") from error


def _require_one_reading(sql: str) -> None:
    statements = duckdb.extract_statements(sql)
    if len(statements) != 1:
        raise LakeError(f"query: must be one statement, got {len(statements)}; give one SELECT")
    kind = statements[0].type
    if kind not in READING:
        raise LakeError(
            f"query: must only read, got {kind.name}; use SELECT, DESCRIBE, SUMMARIZE or EXPLAIN"
        )


def explained(message: str, tables: list[str]) -> str:
    """DuckDB's message in one line, with the tables of the lake where it misses one."""
    text = message.partition("\n\nLINE")[0]
    if "disabled by configuration" in text:
        return "files cannot be read or written from SQL; use the tables, and --out for results"
    missing = re.search(r"Table with name (\S+) does not exist", text)
    if missing is None:
        return f"{' '.join(text.split())}; correct the statement"
    name = missing[1]
    if name in MADE_BY:
        return absent(name)
    near = get_close_matches(name, tables, n=1)
    hint = f"did you mean {near[0]!r}? " if near else ""
    return f"no table is called {name!r}; {hint}there are: {', '.join(tables) or 'none yet'}"


def absent(table: str) -> str:
    """What to say of a table that has not been made."""
    return f"table {table!r} is not there yet: make it with `{MADE_BY[table]}`"
