"""One behaviour of the lake, wherever it lies: a folder, moto's S3, a real S3 server."""

import numpy as np
import pyarrow as pa
import pytest
from s3_servers import BUCKET

from services.errors import LakeError
from services.lake import tables
from services.lake.queries import query
from services.lake.tables import Lake

APPENDER = """
import sys
import pyarrow as pa
from datetime import UTC, datetime
from services.lake.schemas import SCHEMAS
from services.lake.tables import Lake
place, app_id, batches, rows = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
lake, schema = Lake(place), SCHEMAS["datasets"]
print("ready", flush=True)
sys.stdin.readline()
for number in range(1, batches + 1):
    made = [
        {"dataset_id": f"{app_id}/{number}/{k}", "seed": number, "configuration": "x" * 2000,
         "robot": app_id, "layouts": "", "code_version": "", "created_at": datetime.now(UTC)}
        for k in range(rows)
    ]
    lake.append("datasets", pa.Table.from_pylist(made, schema=schema), app_id=app_id, number=number)
    print(number, flush=True)
"""


@pytest.fixture(params=["folder", "moto", pytest.param("radosgw", marks=pytest.mark.slow)])
def place(request, tmp_path, prefix, reach) -> str:
    """Where a lake may lie."""
    if request.param == "folder":
        return str(tmp_path / "lake")
    reach(request.getfixturevalue(request.param))
    return f"s3://{BUCKET}/{prefix}/lake"


def test_vectors_come_back_to_the_bit(place, segments):
    rng = np.random.default_rng(3)
    x, tau = rng.normal(size=(5, 35)), rng.normal(size=(5, 264))
    rows = segments(x, tau)
    assert Lake(place).append("segments", rows, app_id="x", number=1)
    found = Lake(place).read("segments", order_by="solution_index")
    assert found.equals(rows.select(found.column_names))


def test_an_append_is_idempotent(place, datasets):
    lake = Lake(place)
    assert lake.append("datasets", datasets(["a", "b"]), app_id="x", number=1)
    assert not lake.append("datasets", datasets(["a", "b"]), app_id="x", number=1)
    assert lake.append("datasets", datasets(["c"]), app_id="x", number=2)
    assert lake.append("datasets", datasets(["d"]), app_id="y", number=1)
    assert sorted(lake.read("datasets")["dataset_id"].to_pylist()) == ["a", "b", "c", "d"]
    assert lake.last_transaction("datasets", "x") == 2


def test_every_version_can_be_read_again_after_compaction(place, datasets):
    lake, versions = Lake(place), []
    for number in (1, 2, 3):
        lake.append("datasets", datasets([f"d{number}"]), app_id="x", number=number)
        versions.append(lake.version("datasets"))
    lake.compact("datasets")
    for count, version in enumerate(versions, start=1):
        assert lake.read("datasets", version=version).num_rows == count
    assert lake.read("datasets").num_rows == 3
    operations = [commit["operation"] for commit in lake.history("datasets")]
    assert operations == ["OPTIMIZE", "WRITE", "WRITE", "WRITE", "CREATE TABLE"]
    with pytest.raises(LakeError, match="has no version 99; choose one of 0 to 4"):
        lake.read("datasets", version=99)


def test_reading_chooses_sorts_limits_and_joins(place, datasets):
    lake = Lake(place)
    lake.append("datasets", datasets(["a", "b", "c", "d"]), app_id="x", number=1)
    chosen = lake.read("datasets", ["seed"], where="seed > 0", order_by="seed DESC", limit=2)
    assert chosen.to_pydict() == {"seed": [3, 2]}
    pieces = list(lake.batches("datasets", ["seed"], order_by="seed"))
    assert pa.concat_tables(pieces).to_pydict() == {"seed": [0, 1, 2, 3]}
    joined = query(lake, "SELECT count(*) AS n FROM datasets a JOIN datasets b USING (seed)")
    assert joined.to_pydict() == {"n": [4]}


def test_a_missing_table_says_what_makes_it(place):
    lake = Lake(place)
    assert lake.tables() == []
    with pytest.raises(LakeError, match="'solutions' is not there yet: make it with `lmtr gen"):
        lake.read("solutions")


def test_writers_at_once_lose_and_double_nothing(place, spawn):
    batches, rows = 8, 3
    # The two last ones use the same name: each of its batches must be in once.
    names = ["one", "two", "two"]
    writers = [spawn(APPENDER, place, name, batches, rows) for name in names]
    assert [writer.stdout.readline() for writer in writers] == ["ready\n"] * 3
    for writer in writers:
        writer.stdin.write("go\n")
        writer.stdin.flush()
    for writer in writers:
        writer.communicate(timeout=120)
        assert writer.returncode == 0
    found = sorted(Lake(place).read("datasets")["dataset_id"].to_pylist())
    expected = [
        f"{name}/{number}/{k}"
        for name in ("one", "two")
        for number in range(1, batches + 1)
        for k in range(rows)
    ]
    assert found == sorted(expected)


def test_a_killed_writer_leaves_whole_batches_only(place, spawn):
    rows = 20
    writer = spawn(APPENDER, place, "killed", 10_000, rows)
    assert writer.stdout.readline() == "ready\n"
    writer.stdin.write("go\n")
    writer.stdin.flush()
    confirmed = int(writer.stdout.readline())
    writer.kill()
    writer.communicate()
    lake = Lake(place)
    batches = lake.last_transaction("datasets", "killed")
    assert batches >= confirmed
    seeds = lake.read("datasets", ["seed"])["seed"].to_pylist()
    assert sorted(seeds) == sorted(list(range(1, batches + 1)) * rows)


def test_two_who_describe_the_same_at_once_describe_it_once(lake, datasets, monkeypatch):
    row, compared = datasets(["a"]).to_pylist(), tables.lacking

    def slow(*arguments):
        found = compared(*arguments)
        monkeypatch.setattr(tables, "lacking", compared)
        assert Lake(lake.storage).append_rows("datasets", row, app_id="datasets/a")
        return found

    monkeypatch.setattr(tables, "lacking", slow)
    assert not lake.append_rows("datasets", row, app_id="datasets/a")
    assert lake.read("datasets").num_rows == 1
