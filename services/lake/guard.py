"""What a statement may do, judged by its syntax tree: read tables, and nothing else.

DuckDB's own lock keeps files and network away from SQL, but the files of the tables themselves must
be open to it. So statements are read as trees first, and only those whose every part is known to be
harmless are run. (In DuckDB 2 a ``COPY`` inside a ``WITH`` clause parses as a ``SELECT``.)
"""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import duckdb

from services.errors import LakeError
from services.lake.schemas import SCHEMAS
from services.lake.views import VIEWS

READING = (duckdb.StatementType.SELECT, duckdb.StatementType.EXPLAIN)
"""Kinds of statements that are run; DESCRIBE, SHOW, SUMMARIZE, FROM and VALUES are SELECTs."""

NODES = {"SELECT_NODE", "SET_OPERATION_NODE", "RECURSIVE_CTE_NODE", "CTE_NODE"}
"""Kinds of query that only read."""

TABLE_FUNCTIONS = {"unnest", "range", "generate_series", "repeat", "json_each", "json_tree"}
"""Functions that may stand where a table does."""

FORBIDDEN = re.compile(
    r"^(getenv|current_setting|read_.*|glob|sniff_.*|parquet_.*|query|query_table|which_secret"
    r"|duckdb_.*|pragma_.*|.*_scan|write_log|add_parquet_key)$"
)
"""Functions that reach files, settings or the environment, as far as they may be scalar."""

FILE = re.compile(r"[/\\]|^\w+://|\.(parquet|csv|tsv|json|ndjson|jsonl|db|duckdb)(\.\w+)?$", re.I)
"""Names that DuckDB takes for files where no table has them."""

SYSTEM = re.compile(r"^(pg|duckdb|sqlite|pragma)_", re.I)
"""Relations of DuckDB itself; a WITH clause of such a name may still read the relation."""

INFORMATION = "information_schema"
"""The schema that lists tables and columns, and nothing else."""

BUILT_IN = (
    "SELECT 1 FROM (SELECT view_name AS name FROM duckdb_views() "
    "UNION ALL SELECT table_name FROM duckdb_tables()) WHERE lower(name) = ?"
)
"""Whether a relation of this name is there before the lake's are."""

EXPLAIN_OPTIONS = {"analyze", "analyse", "format"}

NO_FILES = "files cannot be read or written from SQL; use the tables, and --out for results"


@dataclass(frozen=True)
class Reading:
    """A statement that only reads.

    Attributes:
        names: Tables that it names, with those of its own WITH clauses.
        lists: Whether it asks which tables there are.
    """

    names: frozenset[str]
    lists: bool


def require_reading(connection: duckdb.DuckDBPyConnection, sql: str) -> Reading:
    """What a statement reads.

    Raises:
        LakeError: It is not one statement, or does more than read tables.
        duckdb.Error: It is no SQL.
    """
    statements = connection.extract_statements(sql)
    if len(statements) != 1:
        raise LakeError(f"query: must be one statement, got {len(statements)}; give one SELECT")
    kind = statements[0].type
    if kind not in READING:
        raise _forbidden(kind.name)
    text = statements[0].query
    if kind == duckdb.StatementType.EXPLAIN:
        explained = _explained(text)
        if connection.extract_statements(explained)[0].type == duckdb.StatementType.COPY:
            raise LakeError(f"query: {NO_FILES}")
        return require_reading(connection, explained)
    (serialized,) = connection.execute("SELECT json_serialize_sql(?)", [text]).fetchall()[0]
    tree: dict[str, Any] = json.loads(serialized)
    if tree["error"]:
        raise LakeError(
            "query: this kind of statement cannot be looked through (PIVOT, CALL and the like); "
            "write it as a SELECT with GROUP BY"
        )
    parts = list(_parts(tree["statements"]))
    for part in parts:
        _require_harmless(part)
    lists = any(part.get("type") == "SHOW_REF" or "show_type" in part for part in parts)
    tables = [part for part in parts if part.get("type") == "BASE_TABLE"]
    named = [part for part in tables if part["schema_name"].lower() != INFORMATION]
    _require_of_lake(connection, named, _own(parts))
    names = frozenset(part["table_name"] for part in named)
    return Reading(names, lists or len(named) < len(tables))


def _explained(text: str) -> str:
    """The statement behind EXPLAIN and its options.

    Raises:
        LakeError: There is none.
    """
    content = text.encode()
    comment = duckdb.token_type.comment
    starts = [at for at, kind in duckdb.tokenize(text) if kind != comment]
    # What lies between two tokens may hold a comment, but their first words tell them.
    words = [content[at:end].decode() for at, end in pairwise([*starts, len(content)])]
    first = [match[0].lower() if (match := re.match(r"\w+|.", word)) else "" for word in words]
    rest = 1
    if first[1:3] and first[1] == "(" and first[2] in EXPLAIN_OPTIONS:
        rest = first.index(")") + 1 if ")" in first else len(first)
    elif first[1:2] and first[1] in EXPLAIN_OPTIONS:
        rest = 2
    if first[:1] != ["explain"] or rest >= len(starts):
        raise LakeError("query: EXPLAIN must be followed by a statement; put a SELECT behind it")
    return content[starts[rest] :].decode()


def _own(parts: list[dict[str, Any]]) -> set[str]:
    """Names of the statement's WITH clauses, in lower case."""
    maps = [part["cte_map"]["map"] for part in parts if part.get("cte_map")]
    return {entry["key"].lower() for entries in maps for entry in entries}


def _require_of_lake(
    connection: duckdb.DuckDBPyConnection, named: list[dict[str, Any]], own: set[str]
) -> None:
    """Refuse relations of DuckDB itself: some tell of its settings.

    Tables, views and the statement's own WITH clauses may be read. A name that nothing has is left
    to DuckDB, which says so.
    """
    for part in named:
        name = part["table_name"].lower()
        if name in SCHEMAS or name in VIEWS:
            continue
        is_own = name in own and not part["schema_name"] and not SYSTEM.match(name)
        if not is_own and (SYSTEM.match(name) or connection.execute(BUILT_IN, [name]).fetchall()):
            raise LakeError(
                f"query: {name} is no table of the lake; `SHOW TABLES` and information_schema list "
                "what there is"
            )


def _parts(tree: object) -> Iterator[dict[str, Any]]:
    if isinstance(tree, dict):
        yield tree
        tree = list(tree.values())
    if isinstance(tree, list):
        for below in tree:
            yield from _parts(below)


def _require_harmless(part: dict[str, Any]) -> None:
    """Refuse a part of the tree that may do more than read tables."""
    kind = part.get("type")
    if kind == "COPY_QUERY_NODE":
        raise LakeError(f"query: {NO_FILES}")
    if isinstance(kind, str) and kind.endswith("_NODE") and kind not in NODES:
        raise _forbidden(kind.removesuffix("_NODE").removesuffix("_QUERY"))
    if kind == "TABLE_FUNCTION":
        name = str(part["function"].get("function_name", "")).lower()
        if name not in TABLE_FUNCTIONS:
            raise LakeError(f"query: {NO_FILES} ({name} is not allowed)")
    function = part.get("function_name")
    if isinstance(function, str) and FORBIDDEN.match(function.lower()):
        raise LakeError(f"query: {NO_FILES} ({function.lower()} is not allowed)")
    if kind == "BASE_TABLE" and FILE.search(part["table_name"]):
        raise LakeError(f"query: {NO_FILES}")


def _forbidden(kind: str) -> LakeError:
    return LakeError(
        f"query: must only read, got {kind}; use SELECT, DESCRIBE, SUMMARIZE or EXPLAIN"
    )
