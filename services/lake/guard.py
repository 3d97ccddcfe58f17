"""What a statement may do, judged by its syntax tree: read tables, and nothing else.

DuckDB's own lock keeps files and network away from SQL, but the files of the tables themselves must
be open to it. So statements are read as trees first, and only those whose every part is known to be
harmless are run. (In DuckDB 2 a ``COPY`` inside a ``WITH`` clause parses as a ``SELECT``.)
"""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import duckdb

from services.errors import LakeError

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

_EXPLAIN = re.compile(r"^\s*EXPLAIN(\s+ANALYZE|\s*\([^)]*\))?\s", re.I)

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
        explained = _EXPLAIN.sub("", text, count=1)
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
    names, lists = set[str](), False
    for part in _parts(tree["statements"]):
        _require_harmless(part)
        if part.get("type") == "BASE_TABLE":
            names.add(part["table_name"])
        lists = lists or part.get("type") == "SHOW_REF" or "show_type" in part
    return Reading(frozenset(names), lists)


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
