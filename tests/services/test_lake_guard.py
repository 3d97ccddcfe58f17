"""Queries reach nothing but the lake's tables, although DuckDB may open their files."""

import duckdb
import numpy as np
import pyarrow as pa
import pytest

from services.errors import LakeError
from services.lake import sources
from services.lake.delta import DeltaTables
from services.lake.guard import INFORMATION, SYSTEM
from services.lake.queries import query
from services.lake.schemas import SCHEMAS
from services.lake.tables import Lake


@pytest.fixture
def filled(lake, datasets, segments):
    lake.append("datasets", datasets(["a", "b"]), app_id="x", number=1)
    lake.append("segments", segments(np.ones((4, 35)), np.ones((4, 264))), app_id="x", number=1)
    lake.append_rows("solutions", [solution(0, True, 2.0), solution(1, False, 6.0)], app_id="x")
    return lake


def solution(index: int, accepted: bool, cost: float) -> dict[str, object]:
    row: dict[str, object] = {field.name: None for field in SCHEMAS["solutions"]}
    for field in SCHEMAS["solutions"]:
        if not field.nullable:
            row[field.name] = "" if pa.types.is_string(field.type) else []
    return row | {
        "dataset_id": "a",
        "index": index,
        "status": "converged",
        "accepted": accepted,
        "reject_reasons": [] if accepted else ["cost", "height"],
        "cost": cost,
        "expected_cost": 4.0,
        "violations": [("height", 0.5), ("force", 0.25)],
        "solve_cpu_s": 1.0 + index,
        "start_pose": [0.0, 0.0, 0.0],
        "goal_pose": [0.6, 0.8, 0.0],
        "obstacles": [0.0] * 6,
        "created_at": 0,
    }


def contents(lake: Lake) -> dict[str, bytes]:
    files = (path for path in lake.storage.folder.rglob("*") if path.is_file())
    return {str(path): path.read_bytes() for path in files}


@pytest.mark.parametrize(
    "sql",
    [
        "WITH w AS (COPY (SELECT 1) TO '{0}' (FORMAT parquet, USE_TMP_FILE false)) FROM w",
        "EXPLAIN ANALYZE WITH w AS (COPY (SELECT 1) TO '{0}' (USE_TMP_FILE false)) FROM w",
        "EXPLAIN /* */ (ANALYZE) WITH w AS (COPY datasets TO '{0}' (USE_TMP_FILE false)) FROM w",
        "COPY (SELECT 1) TO '{0}' (USE_TMP_FILE false)",
        "ATTACH '{0}' AS a",
        "INSTALL httpfs",
        "LOAD httpfs",
        "FROM read_text('{0}')",
        "FROM read_blob('{0}')",
        "FROM read_csv('{0}')",
        "FROM read_parquet('{0}')",
        "FROM parquet_metadata('{0}')",
        "FROM \"Read_Text\"('{0}')",
        "FROM main.read_text('{0}')",
        "FROM system.main.read_text('{0}')",
        "FROM glob('{0}')",
        "FROM '{0}'",
        "FROM 'https://example.org/a.parquet'",
        "FROM read_csv('http://example.org/a.csv')",
        "SELECT getenv('HOME')",
        "SELECT \"GetEnv\"('HOME')",
        "SELECT current_setting('allowed_paths')",
        "FROM duckdb_settings()",
        "FROM query('SELECT 1')",
        "SELECT (SELECT max(content) FROM read_text('{0}'))",
        "PRAGMA version",
        "FROM pg_settings",
        "FROM PG_Settings",
        "FROM pg_catalog.pg_settings",
        "FROM duckdb_logs",
        "FROM sqlite_master",
        "WITH pg_settings AS (FROM pg_settings) FROM pg_settings",
        "EXPLAIN FROM pg_settings",
        "EXPLAIN/**/COPY (SELECT 1) TO '{0}' (USE_TMP_FILE false)",
        "EXPLAIN (ANALYZE)/*)*/COPY (SELECT 1) TO '{0}' (USE_TMP_FILE false)",
        "SET threads = 1",
        "CREATE MACRO m() AS 1",
        "PIVOT datasets ON robot USING count(*)",
    ],
)
def test_nothing_but_tables_is_reached(filled, sql):
    before = contents(filled)
    path = filled.delta("datasets").file_uris()[0]
    with pytest.raises(LakeError) as caught:
        query(filled, sql.format(path))
    assert "\n" not in str(caught.value)
    assert contents(filled) == before


@pytest.mark.parametrize(
    "sql",
    [
        "EXPLAIN/**/SELECT seed FROM datasets",
        "/* ü */EXPLAIN--\nSELECT seed FROM datasets",
        "EXPLAIN/* ü */ANALYZE/**/SELECT seed FROM datasets",
        "explain (format/*)*/json, analyze) SELECT seed FROM datasets",
        "EXPLAIN (SELECT seed FROM datasets)",
        "SHOW TABLES",
        "SHOW ALL TABLES",
        "FROM (SHOW TABLES)",
        "DESCRIBE datasets",
        "SUMMARIZE datasets",
        "DESCRIBE SELECT * FROM accepted_by_distance",
        "FROM memory.main.datasets",
        "WITH RECURSIVE r AS (SELECT 1 n UNION ALL SELECT n + 1 FROM r WHERE n < 3) FROM R",
        "SELECT (WITH a AS (SELECT 1 b) SELECT b FROM a) FROM datasets",
    ],
)
def test_what_only_reads_is_run(filled, sql):
    assert query(filled, sql).num_rows


def test_the_information_schema_lists_tables_and_views(filled):
    listed = query(filled, "SELECT table_name FROM information_schema.tables")
    assert {"datasets", "solutions", "segments_overview"} <= set(listed["table_name"].to_pylist())


def test_no_with_clause_can_stand_for_a_relation_of_duckdb():
    sql = "SELECT schema_name, view_name FROM duckdb_views() WHERE internal"
    with duckdb.connect(":memory:") as connection:
        built_in = connection.execute(sql).fetchall()
    others = [name for schema, name in built_in if schema != INFORMATION]
    assert others
    assert [name for name in others if not SYSTEM.match(name)] == []


def test_a_with_clause_may_take_the_name_of_a_table(filled):
    sql = "WITH datasets AS (FROM main.datasets WHERE seed = 1) SELECT dataset_id FROM datasets"
    assert query(filled, sql).to_pydict() == {"dataset_id": ["b"]}


def test_tables_lie_in_folders_of_any_name(tmp_path, datasets):
    for name in ("it's a # place", "100% sure", "a?b", "ünï"):
        lake = Lake(tmp_path / name)
        lake.append("datasets", datasets(["a"]), app_id="x", number=1)
        assert query(lake, "SELECT dataset_id FROM datasets").num_rows == 1


def test_a_view_without_its_table_says_what_makes_it(lake):
    with pytest.raises(LakeError, match="make it with `lmtr generate`"):
        query(lake, "FROM solve_times")


@pytest.mark.parametrize("remote", [False, True])
@pytest.mark.parametrize("content", [None, b"", b"PAR1" + bytes(200), b"short"])
def test_a_damaged_file_is_no_mistake_in_the_statement(filled, monkeypatch, content, remote):
    if remote:  # then Arrow reads, and DuckDB asks it
        monkeypatch.setattr(sources, "source_of", DeltaTables.dataset)
    (path,) = (filled.storage.folder / "datasets").glob("*.parquet")
    path.unlink() if content is None else path.write_bytes(content)
    says = r"^table 'datasets' cannot be read: .*`lmtr lake check`$"
    for ask in (query, lambda lake, _: lake.read("datasets")):
        with pytest.raises(LakeError, match=says):
            ask(filled, "SELECT * FROM datasets")
