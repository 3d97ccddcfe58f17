"""Tables: idempotent atomic appends, checked rows, reads of any version."""

import re
import time
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.fs as pafs
import pytest
from deltalake import DeltaTable

from services.errors import LakeError
from services.lake.schemas import FINITE, IDENTITY, MADE_BY, SCHEMAS
from services.lake.tables import Lake

APPENDER = """
import sys
from pathlib import Path
import pyarrow as pa
from services.lake.schemas import SCHEMAS
from services.lake.tables import Lake
from datetime import UTC, datetime
folder, app_id, batches, rows = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
lake = Lake(Path(folder))
schema = SCHEMAS["datasets"]
first = (lake.last_transaction("datasets", app_id) or 0) + 1
print("ready", flush=True)
sys.stdin.readline()
for number in range(first, first + batches):
    made = [
        {"dataset_id": f"{app_id}/{number}/{k}", "seed": number, "configuration": "x" * 2000,
         "robot": app_id, "layouts": "", "code_version": "", "created_at": datetime.now(UTC)}
        for k in range(rows)
    ]
    lake.append("datasets", pa.Table.from_pylist(made, schema=schema), app_id=app_id, number=number)
    print(number, flush=True)
"""


@pytest.fixture
def vectors():
    rng = np.random.default_rng(7)
    return rng.normal(size=(4, 35)), rng.normal(size=(4, 264))


@pytest.mark.parametrize("table", SCHEMAS)
def test_every_table_keeps_an_empty_batch_and_its_schema(lake, table):
    schema = SCHEMAS[table]
    assert lake.append(table, schema.empty_table(), app_id="a", number=1)
    assert lake.read(table).schema.equals(schema)
    assert lake.tables() == [table]


def test_tables_are_described_for_their_readers():
    assert MADE_BY.keys() == SCHEMAS.keys() == IDENTITY.keys()
    for name, schema in SCHEMAS.items():
        assert all(field.metadata[b"meaning"] for field in schema)
        assert set(IDENTITY[name]) | set(FINITE.get(name, ())) <= set(schema.names)


def test_an_append_is_idempotent(lake, datasets):
    assert lake.append("datasets", datasets(["a", "b"]), app_id="x", number=1)
    assert not lake.append("datasets", datasets(["a", "b"]), app_id="x", number=1)
    assert lake.append("datasets", datasets(["c"]), app_id="x", number=2)
    assert lake.append("datasets", datasets(["d"]), app_id="y", number=1)
    assert sorted(lake.read("datasets")["dataset_id"].to_pylist()) == ["a", "b", "c", "d"]
    assert lake.last_transaction("datasets", "x") == 2
    assert lake.last_transaction("datasets", "z") is None
    assert lake.last_transaction("solutions", "x") is None


def test_vectors_come_back_to_the_bit_as_fixed_size_lists(lake, segments, vectors):
    lake.append("segments", segments(*vectors), app_id="x", number=1)
    rows = lake.read("segments", ["tau", "x"], order_by="solution_index")
    for name, vector in zip(("x", "tau"), vectors, strict=True):
        found = rows[name].combine_chunks().flatten().to_numpy().reshape(vector.shape)
        np.testing.assert_array_equal(found, vector.astype(np.float32))
    assert rows.schema.field("x").type == pa.list_(pa.float32(), 35)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(("name", "which"), [("x", 0), ("tau", 1)])
def test_vectors_that_are_not_finite_are_refused_by_row(lake, segments, vectors, bad, name, which):
    vectors[which][2, 5] = bad
    said = re.escape(f"column {name!r} must be finite, got {bad} at entry 5 of row 2 (dataset_id=")
    with pytest.raises(LakeError, match=f"{said}'a', .*solution_index=2.*leave that row out"):
        lake.append("segments", segments(*vectors), app_id="x", number=1)
    assert not lake.exists("segments")


def test_rows_must_have_the_schemas_columns_and_types(lake, datasets):
    rows = datasets(["a"])
    seeds = rows.schema.get_field_index("seed")
    wrong = {
        "missing: ['seed']": rows.drop_columns(["seed"]),
        "unknown: ['note']": rows.append_column("note", pa.array(["hm"])),
        "repeated: 1": rows.append_column("seed", pa.array([1])),
        "'seed' must be int64, got double": rows.set_column(seeds, "seed", pa.array([1.5])),
        "'seed' must have a value in every row, got none in row 0 (dataset_id='a')": (
            rows.set_column(seeds, "seed", pa.array([None], pa.int64()))
        ),
    }
    for message, table in wrong.items():
        with pytest.raises(LakeError, match=re.escape(message)):
            lake.append("datasets", table, app_id="x", number=1)
    assert not lake.exists("datasets")


def test_columns_may_come_in_any_order(lake, datasets):
    rows = datasets(["a"])
    lake.append("datasets", rows.select(rows.column_names[::-1]), app_id="x", number=1)
    assert lake.read("datasets").equals(rows)


@pytest.mark.parametrize("ask", [Lake.read, Lake.version, Lake.history, Lake.compact])
def test_a_missing_table_says_what_makes_it(lake, ask):
    with pytest.raises(
        LakeError, match=r"^table 'solutions' is not there yet: make it with `lmtr generate`$"
    ):
        ask(lake, "solutions")


def test_wrong_names_are_answered_with_the_right_ones(lake, datasets):
    with pytest.raises(LakeError, match="no table is called 'dataset'; choose of datasets, "):
        lake.read("dataset")
    lake.append("datasets", datasets(["a"]), app_id="x", number=1)
    with pytest.raises(LakeError, match="no column 'id'; choose of dataset_id, seed, "):
        lake.read("datasets", ["id"])


def test_every_version_can_be_read_again(lake, datasets):
    versions = []
    for number in (1, 2, 3):
        lake.append("datasets", datasets([f"d{number}"]), app_id="x", number=number)
        versions.append(lake.version("datasets"))
    lake.compact("datasets")
    for count, version in enumerate(versions, start=1):
        assert lake.read("datasets", version=version).num_rows == count
    assert lake.read("datasets").num_rows == 3
    assert lake.version("datasets") > versions[-1]
    assert lake.history("datasets")[0]["operation"] == "OPTIMIZE"
    with pytest.raises(LakeError, match="has no version 99; choose one of 0 to "):
        lake.read("datasets", version=99)


def test_reading_chooses_sorts_and_limits(lake, datasets):
    lake.append("datasets", datasets(["a", "b", "c", "d"]), app_id="x", number=1)
    chosen = lake.read(
        "datasets", ["seed"], where="seed > 0 OR false -- not a", order_by="seed DESC", limit=2
    )
    assert chosen.to_pydict() == {"seed": [3, 2]}
    pieces = list(lake.batches("datasets", ["seed"], order_by="seed", limit=3))
    assert pa.concat_tables(pieces).to_pydict() == {"seed": [0, 1, 2]}
    assert lake.query_value("SELECT max(seed) FROM datasets") == 3
    assert lake.query_value("SELECT seed FROM datasets WHERE seed > 99") is None


def test_batches_are_small_and_stop_where_their_reader_does(lake, datasets):
    ids = [f"{k:04d}" for k in range(5000)]
    lake.append("datasets", datasets(ids), app_id="x", number=1)
    pieces = lake.batches("datasets", ["dataset_id"], order_by="dataset_id")
    first = next(pieces)
    assert 0 < first.num_rows < 5000
    rest = [name for piece in pieces for name in piece["dataset_id"].to_pylist()]
    assert first["dataset_id"].to_pylist() + rest == ids


def test_conditions_cannot_reach_beyond_their_table(lake, datasets):
    lake.append("datasets", datasets(["a"]), app_id="x", number=1)
    for where in (
        "true); DROP TABLE datasets; --",
        "seed IN (SELECT 1 FROM read_text('/etc/passwd'))",
    ):
        with pytest.raises(LakeError, match=r"^query: "):
            lake.read("datasets", where=where)


@pytest.mark.parametrize("name", ["with space", "é#?", "100%", "o'clock"])
def test_any_folder_name_works(tmp_path, datasets, name):
    lake = Lake(tmp_path / name)
    for number in (1, 2):
        lake.append("datasets", datasets(["a"]), app_id="x", number=number)
    assert lake.read("datasets").num_rows == 2
    assert (tmp_path / name / "datasets").is_dir()


def test_a_folder_that_delta_would_mistake_is_refused():
    with pytest.raises(LakeError, match="must hold no '%' before"):
        Lake(Path("/data/a%20b"))


@pytest.mark.parametrize("unfit", ["[", "]", "^", "|", "\\", "\n", "\x7f", "\udc80"])
def test_folders_in_which_tables_cannot_be_kept_are_refused(tmp_path, unfit):
    with pytest.raises(LakeError, match=r"its path must hold no .*choose another folder$"):
        Lake(tmp_path / f"{unfit}run" / "lake")


def test_a_table_of_another_schema_version_is_not_touched(lake, datasets):
    lake.append("datasets", datasets(["a"]), app_id="x", number=1)
    log = min((lake.storage.folder / "datasets" / "_delta_log").glob("*.json"))
    written = log.read_text()
    assert '"lmtr.schemaVersion":"1"' in written
    log.write_text(written.replace('"lmtr.schemaVersion":"1"', '"lmtr.schemaVersion":"9"'))
    with pytest.raises(LakeError, match="is of schema version 9, this LMTR knows version 1"):
        lake.append("datasets", datasets(["b"]), app_id="x", number=2)


def test_a_table_that_cannot_be_written_says_so(tmp_path, datasets):
    (tmp_path / "lake").write_text("a file is in the way")
    with pytest.raises(LakeError, match=r"'datasets' cannot be written: .*check space and perm"):
        Lake(tmp_path / "lake").append("datasets", datasets(["a"]), app_id="x", number=1)


def test_writers_at_once_lose_and_double_nothing(tmp_path, spawn):
    folder, batches, rows = tmp_path / "lake", 8, 5
    # The two last ones use the same name: each of its batches must be in once.
    names = ["one", "two", "two"]
    writers = [spawn(APPENDER, folder, name, batches, rows) for name in names]
    assert [writer.stdout.readline() for writer in writers] == ["ready\n"] * 3
    for writer in writers:
        writer.stdin.write("go\n")
        writer.stdin.flush()
    for writer in writers:
        writer.communicate(timeout=60)
        assert writer.returncode == 0
    found = sorted(Lake(folder).read("datasets")["dataset_id"].to_pylist())
    expected = [
        f"{name}/{number}/{k}"
        for name in ("one", "two")
        for number in range(1, batches + 1)
        for k in range(rows)
    ]
    assert found == sorted(expected)


def test_a_killed_writer_leaves_whole_batches_only(tmp_path, spawn):
    folder, rows = tmp_path / "lake", 40
    for delay in (0.0, 0.011, 0.023):
        writer = spawn(APPENDER, folder, "killed", 10_000, rows)
        assert writer.stdout.readline() == "ready\n"
        writer.stdin.write("go\n")
        writer.stdin.flush()
        confirmed = int(writer.stdout.readline())
        time.sleep(delay)
        writer.kill()
        writer.communicate()
        lake = Lake(folder)
        batches = lake.last_transaction("datasets", "killed")
        assert batches >= confirmed
        seeds = lake.read("datasets", ["seed"])["seed"].to_pylist()
        assert sorted(seeds) == sorted(list(range(1, batches + 1)) * rows)


def test_a_task_whose_work_failed_is_a_row_without_a_trajectory(lake):
    failed = {
        "dataset_id": "a",
        "index": 7,
        "status": "error",
        "message": "MemoryError",
        "accepted": False,
        "reject_reasons": ["not_converged:error"],
        "cost_terms": [],
        "constraint_violation": [("dynamics", 0.5)],
        "violations": [],
        "code_version": "0",
        "config_hash": "0",
        "created_at": datetime(2026, 11, 22, tzinfo=UTC),
    }
    rows = pa.Table.from_pylist([failed], schema=SCHEMAS["solutions"])
    assert lake.append("solutions", rows, app_id="x", number=1)
    found = lake.read("solutions").to_pylist()[0]
    assert {name: found[name] for name in failed} == failed
    assert all(found[name] is None for name in found.keys() - failed.keys())


def test_a_table_whose_columns_differ_is_refused_by_their_names(tmp_path):
    folder = tmp_path / "lake"
    old = pa.schema([field for field in SCHEMAS["cuts"] if field.name != "settings"])
    DeltaTable.create(
        str(folder / "cuts"),
        old,
        configuration={"lmtr.schemaVersion": "1"},
        raise_if_key_not_exists=False,
    )
    with pytest.raises(LakeError, match=r"differs in settings.*another home"):
        Lake(folder).read("cuts")


def test_no_thread_of_arrows_holds_a_file_of_pythons(lake, datasets):
    # Such a thread may let go of it after the interpreter has ended, which aborts the process.
    lake.append("datasets", datasets(["a"]), app_id="x", number=1)
    scanned = lake.dataset("datasets", lake.delta("datasets"))
    inner = scanned.filesystem
    while isinstance(inner, pafs.SubTreeFileSystem):
        inner = inner.base_fs
    assert isinstance(inner, pafs.LocalFileSystem)
    assert scanned.to_table()["dataset_id"].to_pylist() == ["a"]
