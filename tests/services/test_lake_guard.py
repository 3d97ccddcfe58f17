"""Queries reach nothing but the lake's tables, although DuckDB may open their files."""

import os

import duckdb
import numpy as np
import pyarrow as pa
import pytest

from services.errors import LakeError
from services.lake import sandbox, sources
from services.lake.delta import DeltaTables
from services.lake.guard import INFORMATION, SYSTEM, Reading
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
        "SET enable_external_access = true",
        "RESET lock_configuration",
        "PRAGMA enable_external_access",
        "PRAGMA database_list",
        "EXPORT DATABASE '{0}.d'",
        "IMPORT DATABASE '{0}.d'",
        "USE memory",
        "DETACH memory",
        "CHECKPOINT",
        "VACUUM",
        "CREATE TABLE t AS SELECT 1",
        "CREATE SECRET s (TYPE s3)",
        "INSERT INTO datasets FROM datasets",
        "DROP VIEW datasets",
        "COMMENT ON VIEW datasets IS 'x'",
        "PREPARE p AS SELECT 1",
        "CALL pragma_version()",
        "SELECT 1; COPY (SELECT 1) TO '{0}'",
        "FROM duckdb_secrets()",
        "FROM duckdb_extensions()",
        "FROM read_json('{0}')",
        "FROM read_ndjson_objects('{0}')",
        "FROM sniff_csv('{0}')",
        "FROM parquet_schema('{0}')",
        "FROM 'file://{0}'",
        "FROM 's3://bucket/a.parquet'",
        "SUMMARIZE '{0}'",
        "DESCRIBE FROM read_text('{0}')",
        "FROM datasets, LATERAL (FROM read_text('{0}'))",
        "FROM datasets ORDER BY (SELECT content FROM read_text('{0}'))",
        "FROM datasets WHERE getenv('HOME') = ''",
        "SELECT list_transform([1], x -> getenv('HOME'))",
        "FROM query_table('datasets')",
        "FROM json_execute_serialized_sql(json_serialize_sql('SELECT 1'))",
        "FROM enable_logging()",
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
        "FROM read_text('{0}')",
        "FROM read_blob('{0}')",
        "FROM read_csv('{0}')",
        "FROM '{0}'",
        "FROM glob('{1}/*')",
        "FROM read_text('{1}/../*')",
        "FROM read_csv('http://127.0.0.1:1/a.csv')",
        "COPY (SELECT 1) TO '{1}/stolen.csv'",
        "ATTACH '{1}/stolen.db'",
        "EXPORT DATABASE '{1}/stolen'",
        "INSTALL httpfs",
        "LOAD httpfs",
        "SET enable_external_access = true",
        "SET lock_configuration = false",
        "RESET allowed_paths",
        "SET allowed_directories = ['/']",
        "SELECT getenv('HOME')",
        "CREATE SECRET s (TYPE s3)",
    ],
)
def test_duckdb_is_locked_even_for_what_the_look_at_a_statement_would_miss(
    filled, tmp_path, monkeypatch, sql
):
    monkeypatch.setattr(sandbox, "require_reading", lambda *_: Reading(frozenset(), lists=False))
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "secret").write_text("the words of the secret")
    told = []
    with (
        pytest.raises(LakeError) as caught,
        sandbox.evaluated(filled.sources(), sql.format(outside / "secret", outside)) as result,
    ):
        told += result.fetchall()
    assert told == []
    assert "words" not in str(caught.value)
    assert [path.name for path in outside.iterdir()] == ["secret"]


def as_a_link(file, secret):
    """A link in the place of a file."""
    file.unlink()
    file.symlink_to(secret)


def in_a_linked_folder(file, secret):
    """A link in the place of a folder of the table, which the log leads into."""
    (file.parent / "part").symlink_to(secret.parent)
    rename(file, f"part/{secret.name}")


def by_the_log(file, secret):
    """An entry of the log that leads out of the table."""
    rename(file, os.path.relpath(secret, file.parent))


def by_a_whole_path(file, secret):
    """An entry of the log with the path from the root."""
    rename(file, f"file://{secret}")


def rename(file, name):
    """Have a table's log call a file by another name."""
    for entry in (file.parent / "_delta_log").glob("*.json"):
        entry.write_text(entry.read_text().replace(file.name, name))


WAYS = [as_a_link, in_a_linked_folder, by_the_log, by_a_whole_path]


@pytest.mark.parametrize("remote", [False, True])
@pytest.mark.parametrize("lead_out", WAYS)
def test_a_lake_of_others_cannot_lead_out_of_itself(
    filled, tmp_path, datasets, monkeypatch, lead_out, remote
):
    if remote:  # then Arrow reads, and DuckDB asks it
        monkeypatch.setattr(sources, "source_of", DeltaTables.dataset)
    other = Lake(tmp_path / "other" / "lake")
    other.append("datasets", datasets(["secret"]), app_id="x", number=1)
    (secret,) = (other.storage.folder / "datasets").glob("*.parquet")
    (file,) = (filled.storage.folder / "datasets").glob("*.parquet")
    lead_out(file, secret)
    asks = (
        lambda lake: query(lake, "SELECT dataset_id FROM datasets").to_pylist(),
        lambda lake: lake.read("datasets", ["dataset_id"]).to_pylist(),
        lambda lake: [batch.to_pylist() for batch in lake.scan("datasets", ["dataset_id"])],
    )
    for ask in asks:
        with pytest.raises(LakeError, match="table 'datasets' cannot be read") as caught:
            ask(Lake(filled.storage.folder))
        assert "'secret'" not in str(caught.value)
    assert query(other, "SELECT dataset_id FROM datasets").num_rows == 1


def test_a_table_may_lie_behind_a_link(filled, tmp_path):
    (tmp_path / "linked").symlink_to(filled.storage.folder)
    assert query(Lake(tmp_path / "linked"), "FROM datasets").num_rows == 2


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
