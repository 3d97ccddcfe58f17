"""SQL over the lake: what is answered, what is refused, how results are written."""

import csv
import json
import re
from datetime import UTC, datetime
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from services.errors import LakeError, OutputError
from services.lake.queries import query, streamed, write_result
from services.lake.schemas import SCHEMAS
from services.lake.tables import Lake
from services.lake.views import DOCUMENTED, VIEWS


@pytest.fixture
def filled(lake, datasets):
    lake.append("datasets", datasets(["a", "b"]), app_id="x", number=1)
    return lake


def test_a_query_joins_sorts_and_counts(filled):
    sql = """
        WITH later AS (FROM datasets WHERE created_at > '2020-01-01')
        SELECT d.dataset_id, count(*) AS n FROM datasets d JOIN later USING (dataset_id)
        GROUP BY ALL ORDER BY 1 DESC; -- one statement, with a comment
    """
    assert query(filled, sql).to_pydict() == {"dataset_id": ["b", "a"], "n": [1, 1]}


@pytest.mark.parametrize(
    "sql",
    [
        "DESCRIBE datasets",
        "SHOW TABLES",
        "SUMMARIZE datasets",
        "EXPLAIN SELECT * FROM datasets",
        "EXPLAIN ANALYZE SELECT * FROM datasets",
        "FROM datasets",
        "VALUES (1)",
    ],
)
def test_everything_that_reads_is_answered(filled, sql):
    assert query(filled, sql).num_rows > 0


@pytest.mark.parametrize(
    ("sql", "kind"),
    [
        ("COPY datasets TO '{0}'", "COPY"),
        ("ATTACH '{0}'", "ATTACH"),
        ("INSTALL httpfs", "LOAD"),
        ("LOAD httpfs", "LOAD"),
        ("PRAGMA version", "PRAGMA"),
        ("SET threads = 1", "SET"),
        ("RESET lock_configuration", "SET"),
        ("CREATE TABLE t (i INT)", "CREATE"),
        ("DROP VIEW datasets", "DROP"),
        ("INSERT INTO datasets SELECT * FROM datasets", "INSERT"),
        ("DELETE FROM datasets", "DELETE"),
        ("EXPORT DATABASE '{0}'", "EXPORT"),
        ("CALL pragma_version()", "CALL"),
    ],
)
def test_everything_else_is_refused(filled, tmp_path, sql, kind):
    out = tmp_path / "out"
    with pytest.raises(LakeError, match=f"must only read, got {kind}; use SELECT"):
        query(filled, sql.format(out))
    assert not out.exists()


@pytest.mark.parametrize(
    "sql",
    [
        "SELECT * FROM read_csv('/etc/passwd')",
        "SELECT * FROM read_text('/etc/passwd')",
        "SELECT * FROM read_blob('{0}/lake/datasets/*.parquet')",
        "SELECT * FROM read_parquet('{0}/lake/datasets/*.parquet')",
        "SELECT * FROM glob('/etc/*')",
        "WITH w AS (COPY (SELECT 1) TO '{0}/out') SELECT * FROM w",
        "WITH w AS (COPY (SELECT 1) TO '.tmp/out') SELECT * FROM w",
        "EXPLAIN ANALYZE COPY (SELECT 1) TO '{0}/out'",
    ],
)
def test_no_statement_reaches_a_file(filled, tmp_path, sql):
    with pytest.raises(LakeError, match="files cannot be read or written from SQL"):
        query(filled, sql.format(tmp_path))
    assert not (tmp_path / "out").exists()


def test_a_file_or_a_python_variable_is_no_table(filled):
    secret = pa.table({"token": ["s3cret"]})
    assert secret.num_rows == 1
    for name in ("secret", "filled"):
        with pytest.raises(LakeError, match="no table is called"):
            query(filled, f"SELECT * FROM {name}")
    with pytest.raises(LakeError, match="files cannot be read"):
        query(filled, "SELECT * FROM '/etc/passwd'")


@pytest.mark.parametrize("sql", ["", "  -- nothing", "SELECT 1; SELECT 2"])
def test_exactly_one_statement_is_run(filled, sql):
    with pytest.raises(LakeError, match=r"must be one statement, got [02]; give one SELECT"):
        query(filled, sql)


def test_mistakes_are_explained_in_one_line(filled):
    mistakes = {
        "SELEC 1": 'syntax error at or near "SELEC"',
        "SELECT sed FROM datasets": 'Candidate bindings: "seed"',
        "SELECT * FROM dataset": "no table is called 'dataset'; did you mean 'datasets'?",
        "SELECT * FROM nope": "no table is called 'nope'; there are: datasets",
        "SELECT * FROM rollouts": "'rollouts' is not there yet: make it with `lmtr evaluate`",
        "SELECT CAST(dataset_id AS INT) FROM datasets": "Could not convert string 'a'",
    }
    for sql, message in mistakes.items():
        with pytest.raises(LakeError, match=re.escape(message)) as caught:
            query(filled, sql)
        assert "\n" not in str(caught.value)


def test_an_empty_lake_says_that_it_is_empty(lake):
    assert query(lake, "SHOW TABLES").num_rows == 0
    with pytest.raises(LakeError, match="there are: none yet"):
        query(lake, "SELECT * FROM nope")


def test_columns_of_the_same_name_are_told_apart(filled):
    result = query(filled, "SELECT 1 AS a, 2 AS a, 3 AS a_1, 4 AS a")
    assert result.num_columns == len(set(result.column_names)) == 4
    assert [column[0].as_py() for column in result.columns] == [1, 2, 3, 4]


RICH = """
    SELECT * FROM (VALUES
        (1, 'é, "x"', [1.5, 2.0]::DOUBLE[], MAP {'cost': 0.25}::MAP(VARCHAR, DOUBLE), true),
        (2, NULL, ['nan'::DOUBLE, 1.0], MAP {}::MAP(VARCHAR, DOUBLE), false)
    ) t(i, name, numbers, terms, ok), (SELECT created_at FROM datasets LIMIT 1)
    ORDER BY i
"""


def test_json_is_one_array_of_objects_without_nan(filled, tmp_path):
    write_result(query(filled, RICH), tmp_path / "r.json", "json")
    first, second = json.loads(
        (tmp_path / "r.json").read_text(encoding="utf-8"), parse_constant=pytest.fail
    )
    assert first == {
        "i": 1,
        "name": 'é, "x"',
        "numbers": [1.5, 2.0],
        "terms": {"cost": 0.25},
        "ok": True,
        "created_at": "2026-11-22T12:30:00+00:00",
    }
    assert second["name"] is None
    assert second["numbers"] == [None, 1.0]


def test_csv_holds_lists_and_maps_as_json(filled, tmp_path):
    write_result(query(filled, RICH), tmp_path / "r.csv", "csv")
    with (tmp_path / "r.csv").open(encoding="utf-8", newline="") as file:
        first, second = csv.DictReader(file)
    assert (first["i"], first["name"], first["ok"]) == ("1", 'é, "x"', "true")
    assert json.loads(first["numbers"]) == [1.5, 2.0]
    assert json.loads(first["terms"]) == {"cost": 0.25}
    assert second["name"] == ""


def test_parquet_gives_the_same_table_back(filled, tmp_path):
    result = query(filled, "SELECT * FROM datasets ORDER BY dataset_id")
    write_result(result, tmp_path / "new" / "r.parquet", "parquet")
    assert pq.read_table(tmp_path / "new" / "r.parquet").equals(result)


def test_no_rows_are_a_valid_result_in_every_format(filled, tmp_path):
    result = query(filled, "SELECT seed, dataset_id FROM datasets WHERE false")
    for form in ("csv", "json", "parquet"):
        write_result(result, tmp_path / form, form)
    assert (tmp_path / "csv").read_text() == "seed,dataset_id\n"
    assert json.loads((tmp_path / "json").read_text()) == []
    assert pq.read_table(tmp_path / "parquet").num_rows == 0


def test_without_a_path_the_result_goes_to_standard_output(filled, capfdbinary):
    write_result(query(filled, "SELECT 1 AS a"), None, "csv")
    assert capfdbinary.readouterr().out == b"a\n1\n"


def test_a_format_or_file_that_is_impossible_is_refused(filled, tmp_path):
    result = query(filled, "SELECT 1 AS a")
    with pytest.raises(LakeError, match="one of csv, json, parquet, got 'xlsx'"):
        write_result(result, tmp_path / "r.xlsx", "xlsx")
    with pytest.raises(OutputError, match="no regular file"):
        write_result(result, tmp_path, "csv")
    assert list(tmp_path.glob(".*partial")) == []


REFUSED = [
    "WITH w AS (COPY (SELECT 1) TO '{file}' (USE_TMP_FILE false)) SELECT * FROM w",
    "EXPLAIN ANALYZE WITH w AS (COPY (SELECT 1) TO '{file}') SELECT * FROM w",
    "SELECT * FROM (WITH w AS (COPY (SELECT 1) TO '{file}') SELECT * FROM w)",
    "SELECT * FROM read_parquet('{file}')",
    "SELECT * FROM \"read_parquet\"('{file}')",
    "SELECT * FROM main.read_text('{file}')",
    "SELECT * FROM parquet_metadata('{file}')",
    "SELECT * FROM glob('{folder}/*')",
    "SELECT * FROM '{file}'",
    "SELECT seed, (SELECT content FROM read_blob('{file}')) FROM datasets",
    "SELECT getenv('HOME')",
    "SELECT \"getenv\"('HOME')",
    "SELECT current_setting('allowed_paths')",
    "SELECT * FROM duckdb_settings()",
    "SELECT * FROM query('SELECT 1')",
    "SELECT * FROM 'http://127.0.0.1:1/x.parquet'",
    "ATTACH '{folder}/new.db'",
    "INSTALL httpfs",
    "LOAD httpfs",
    "SET enable_external_access = true",
    "PRAGMA database_list",
    "CREATE MACRO m() AS TABLE SELECT * FROM read_text('{file}')",
    "PIVOT datasets ON robot USING count(*)",
    "CALL pragma_version()",
]


@pytest.mark.parametrize("sql", REFUSED)
def test_what_does_more_than_read_tables_is_refused_and_changes_nothing(filled, tmp_path, sql):
    folder = filled.storage.folder / "datasets"
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    file = next(folder.glob("*.parquet"))
    with pytest.raises(LakeError, match=r"^query: [^\n]+$"):
        query(filled, sql.format(file=file, folder=folder))
    after = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    assert after == before


def test_what_only_reads_is_run(filled):
    for sql in (
        "SELECT * FROM range(3)",
        "SELECT unnest([1, 2]) FROM datasets",
        "WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n WHERE k < 4) FROM n",
        "SELECT * FROM datasets UNION ALL SELECT * FROM datasets",
        "EXPLAIN SELECT * FROM datasets",
        "EXPLAIN ANALYZE SELECT * FROM datasets",
        "SUMMARIZE datasets",
        "DESCRIBE datasets",
        "SHOW TABLES",
        "FROM datasets SELECT seed ORDER BY seed",
        "VALUES (1)",
    ):
        assert query(filled, sql).num_rows > 0, sql


def solution(**changes):
    """A row of ``solutions`` over two lines, to a goal a metre away."""
    return {
        "dataset_id": "a",
        "status": "converged",
        "reject_reasons": [],
        "cost_terms": [],
        "constraint_violation": [],
        "violations": [("closest_foothold_1", 0.2)],
        "start_pose": [0.0, 0.0, 0.0],
        "goal_pose": [1.0, 0.0, 0.0],
        "obstacles": [0.5, 0.0, 1.5, 0.8, 0.0, 1.6],
        "code_version": "0",
        "config_hash": "0",
        "created_at": datetime(2026, 11, 25, tzinfo=UTC),
        **changes,
    }


def test_views_say_what_the_tables_do(tmp_path):
    lake = Lake(tmp_path / "views")
    rows = [
        {"index": 0, "accepted": True, "cost": 3.0, "expected_cost": 2.5, "goal_pose": [3.0, 4, 0]},
        {"index": 1, "accepted": False, "cost": 9.0, "reject_reasons": ["cost", "flight"]},
        {"index": 2, "accepted": False, "cost": 8.0, "reject_reasons": ["cost"]},
    ]
    made = pa.Table.from_pylist([solution(**row) for row in rows], schema=SCHEMAS["solutions"])
    lake.append("solutions", made, app_id="x", number=1)
    seen = query(lake, "SELECT * FROM solutions_overview ORDER BY index").to_pylist()
    assert [row["distance_m"] for row in seen] == [5.0, 1.0, 1.0]
    assert [row["cost_above_expected"] for row in seen] == [0.5, None, None]
    assert [row["lines"] for row in seen] == [2, 2, 2]
    reasons = query(lake, "SELECT reason, solutions FROM rejection_reasons").to_pylist()
    assert reasons == [
        {"reason": "cost", "solutions": 2},
        {"reason": "flight", "solutions": 1},
    ]
    by_distance = query(lake, "SELECT distance_m, accepted_share FROM accepted_by_distance")
    assert by_distance.to_pydict() == {"distance_m": [1.0, 5.0], "accepted_share": [0.0, 1.0]}
    with pytest.raises(LakeError, match="table 'segments' is not there yet"):
        query(lake, "SELECT * FROM segments_overview")


def evaluation(number, close_share, violation, **changes):
    """A row of ``evaluations``."""
    summary = [("close_share", close_share), ("mean_violation", violation), ("diverged", 0.0)]
    return {
        "evaluation_id": f"e{number}",
        "dataset_id": "a",
        "segmentation_id": "cut",
        "replanner": f"r{number}",
        "weights": [1.0, 1.0, 1.0, 1.0],
        "planner": "{}",
        "settings": "{}",
        "seed": 0,
        "summary": summary,
        "segments_version": 0,
        "mlflow_run_id": "",
        "code_version": "0",
        "created_at": datetime(2026, 11, 26, tzinfo=UTC),
        "policy": "nearest",
        "purpose": "report",
        **changes,
    }


def test_the_documented_front_is_the_one_of_each_replanner_and_policy(tmp_path):
    lake = Lake(tmp_path / "fronts")
    rows = [
        evaluation(0, 0.1, 0.003),
        evaluation(1, 0.2, 0.001),
        evaluation(2, 0.2, 0.002),  # behind the one before
        evaluation(3, 0.05, 0.0005, purpose="tuning"),
        evaluation(4, 0.3, 0.004, latent=3, training_seed=0),
        evaluation(5, 0.3, 0.005, latent=3, training_seed=1),
        evaluation(6, 0.4, 0.009, policy="selected"),
        evaluation(7, 0.0, 0.0, summary=[("close_share", 0.0), ("diverged", 2.0)]),
    ]
    lake.append_rows("evaluations", rows, app_id="x")
    front = query(lake, DOCUMENTED["The Pareto front over w of each replanner"]).to_pylist()
    assert {row["replanner"] for row in front} == {"r0", "r1", "r4", "r5", "r6"}


def test_a_result_comes_a_batch_at_a_time(filled):
    with streamed(filled, "SELECT range AS k, range AS k FROM range(5000)") as result:
        first = next(iter(result))
        assert 0 < first.num_rows < 5000
        assert result.schema.names == ["k", "k_1"]
        rest = result.read_all()
    assert first.num_rows + rest.num_rows == 5000


def test_the_page_shows_exactly_the_documented_queries():
    page = (Path(__file__).parents[2] / "docs" / "queries.md").read_text(encoding="utf-8")
    shown = {" ".join(sql.split()) for sql in re.findall(r"```sql\n(.*?)```", page, re.S)}
    assert shown == {" ".join(sql.split()) for sql in DOCUMENTED.values()}
    assert all(f"`{name}`" in page for name in VIEWS)
