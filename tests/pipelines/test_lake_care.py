"""``lmtr lake``: exit statuses, what is said, and what only the joined tables can tell."""

import json
import shutil
from datetime import UTC, datetime

import numpy as np
import pyarrow as pa
import pytest
from deltalake import DeltaTable
from s3_servers import BUCKET

from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT
from pipelines.lake_care.look import entry_names
from pipelines.records import error_columns, to_json
from services.home import Home
from services.lake.appender import Appender, Group
from services.lake.delta import VERSION_KEY
from services.lake.digest import sealed
from services.lake.log import entry_path
from services.lake.migration import outdated
from services.lake.schemas import SCHEMAS, SEGMENT_SIZE, TASK_SIZE
from services.lake.tables import Lake

MADE = {"code_version": "0", "created_at": datetime(2026, 11, 22, tzinfo=UTC)}


def dataset(**changes):
    layouts = {"task": TASK_LAYOUT.metadata(), "segment": SEGMENT_LAYOUT.metadata()}
    return {
        "dataset_id": "a",
        "seed": 0,
        "configuration": '{"dataset": {"solutions": 3}}',
        "robot": "anymal",
        "layouts": to_json(layouts),
        **MADE,
        **changes,
    }


def segments(solution_index):
    columns = {
        "dataset_id": ["a"],
        "solution_index": [solution_index],
        "segmentation_id": ["cut"],
        "epoch_s": [0.5],
        "goal_time_s": [2.0],
        "split": ["train"],
        "x": [np.arange(TASK_SIZE, dtype=np.float32).tolist()],
        "tau": [np.zeros(SEGMENT_SIZE, dtype=np.float32).tolist()],
    }
    schema = pa.schema([SCHEMAS["segments"].field(name) for name in columns])
    return sealed("segments", pa.table(columns, schema=schema))


@pytest.fixture
def home(tmp_path):
    """A home with one data set of two failed solutions; nothing is wrong with it."""
    return filled(tmp_path / "home")


def filled(place):
    home = Home.open(place, create=True)
    lake = Lake(home.lake)
    lake.append_rows("datasets", [dataset()], app_id="d")
    for index in (0, 1):
        row = {"dataset_id": "a", "index": index, "config_hash": "0", **MADE}
        row |= error_columns("out of luck")
        rows = pa.Table.from_pylist([row], schema=SCHEMAS["solutions"])
        lake.append("solutions", sealed("solutions", rows), app_id="s", number=index + 1)
    cut = {"dataset_id": "a", "segmentation_id": "cut", "settings": "{}", **MADE}
    lake.append_rows("cuts", [cut], app_id="c")
    return home


def findings(lmtr, home):
    status, out, _ = lmtr("--home", home.name, "lake", "check", "--format", "json")
    told = json.loads(out)
    assert status == (0 if told["clean"] else 1)
    return {each["kind"]: each for each in told["findings"]}


def test_a_sound_lake_is_clean_and_says_how_far_it_is(lmtr, home):
    status, out, _ = lmtr("--home", home.root, "lake", "check", "--format", "json")
    told = json.loads(out)
    assert (status, told["clean"], told["findings"]) == (0, True, [])
    assert told["data_sets"] == [
        {"dataset_id": "a", "asked_first": 3, "solved": 2, "accepted": 0, "segments": 0}
    ]
    assert "nothing is wrong" in lmtr("--home", home.root, "lake", "check")[1]


def test_segments_of_what_was_not_accepted_are_named(lmtr, home):
    lake = Lake(home.lake)
    for number, index in enumerate((1, 7), start=1):
        lake.append("segments", segments(index), app_id="g", number=number)
    found = findings(lmtr, home)
    assert found.keys() == {"reference"}
    assert found["reference"]["subjects"] == ["a, solution 1", "a, solution 7"]


def test_solutions_of_no_data_set_and_other_layouts_are_named(lmtr, home):
    lake = Lake(home.lake)
    shorter = {**TASK_LAYOUT.metadata(), "fields": [], "size": 0}
    other = to_json({"task": shorter, "segment": SEGMENT_LAYOUT.metadata()})
    lake.append_rows("datasets", [dataset(dataset_id="b", layouts=other)], app_id="b")
    cut = {"dataset_id": "z", "segmentation_id": "cut", "settings": "{}", **MADE}
    lake.append_rows("cuts", [cut], app_id="z")
    found = findings(lmtr, home)
    assert found["reference"]["subjects"] == ["z"]
    assert found["layout"]["subjects"][0].startswith("b: layout 'task' version 1")


def test_a_torn_log_is_found_repaired_and_clean_again(lmtr, home):
    (home.lake / "solutions" / entry_path(2)).write_bytes(b"")
    assert findings(lmtr, home)["log"]["count"] == 1
    status, out, _ = lmtr("--home", home.root, "lake", "repair")
    assert status == 0
    assert "solutions: its log is whole up to version 1" in out
    assert "solutions: 1 row salvaged, 0 lost" in out
    assert "`lmtr generate` makes what is missing again" in out
    assert findings(lmtr, home) == {}


def test_a_torn_log_is_told_in_a_line_that_names_the_check(lmtr, home):
    (home.lake / "solutions" / entry_path(2)).write_bytes(b'{"add')
    status, _, err = lmtr("--home", home.root, "lake", "info")
    assert (status, err.count("\n"), "0: " in err) == (2, 1, False)
    assert err.endswith("look what is wrong with `lmtr lake check`\n")
    assert findings(lmtr, home)["table"]["subjects"] == ["not before its log is mended"]


def test_solutions_of_no_table_of_data_sets_are_named(lmtr, home):
    shutil.rmtree(home.lake / "datasets")
    assert findings(lmtr, home)["reference"]["subjects"] == ["a"]


def test_a_table_that_cannot_be_repaired_does_not_stop_the_others(lmtr, home):
    DeltaTable(home.lake / "datasets").alter.set_table_properties({VERSION_KEY: "99"}, False)
    (home.lake / "solutions" / entry_path(2)).write_bytes(b"")
    status, out, err = lmtr("--home", home.root, "lake", "repair")
    assert status == 2
    assert "datasets not repaired" in err
    assert "solutions: 1 row salvaged, 0 lost" in out


def test_an_older_table_is_not_migrated_under_a_generation(lmtr, home):
    delta = DeltaTable(home.lake / "solutions")
    delta.alter.set_table_properties({VERSION_KEY: "1"}, False)
    migrate = ("--home", home.root, "lake", "migrate")
    with home.lock("generate-a"):
        status, _, err = lmtr(*migrate)
        assert (status, "`lmtr generate` (process " in err) == (2, True)
        assert outdated(Lake(home.lake), "solutions") == "1"
    assert "solutions: schema version 1 → 2" in lmtr(*migrate)[1]


def test_a_store_is_looked_after_like_a_folder(lmtr, moto, reach, prefix):
    reach(moto)
    home = filled(f"s3://{BUCKET}/{prefix}")
    at = ("--home", home.name, "lake")
    table, client = f"{prefix}/lake/solutions", moto.client()
    client.put_object(Bucket=BUCKET, Key=f"{table}/{entry_path(2)}", Body=b"{")
    client.put_object(Bucket=BUCKET, Key=f"{prefix}/lake/cuts/left.parquet", Body=b"?")
    assert findings(lmtr, home).keys() == {"log", "table"}
    status, out, err = lmtr(*at, "repair")
    assert (status, "other machines" in err) == (0, True)
    assert "solutions: 1 row salvaged, 0 lost" in out
    assert findings(lmtr, home) == {}
    assert "cuts: 1 file, 1 B, deleted" in lmtr(*at, "vacuum", "cuts", "--grace", "0")[1]
    assert lmtr(*at, "compact", "solutions")[1] == "solutions: 2 files, now 1\n"
    assert "is of schema version 2 already" in lmtr(*at, "migrate")[1]
    assert findings(lmtr, home) == {}
    assert f"{table}/_quarantine/{entry_path(2)}" in moto.objects(table)


def test_history_is_not_forgotten_by_accident(lmtr, home):
    status, _, err = lmtr("--home", home.root, "lake", "vacuum", "--forget-history")
    assert status == 2
    assert "add --yes" in err
    lake = Lake(home.lake)
    assert lmtr("--home", home.root, "lake", "compact")[0] == 0
    clear = ("--home", home.root, "lake", "vacuum", "solutions", "--forget-history")
    before = lmtr(*clear, "--grace", "0", "--dry-run")[1]
    assert before.startswith("solutions: 2 files, ")
    assert lake.read("solutions", version=1).num_rows == 1
    assert lmtr(*clear, "--grace", "0", "--yes")[0] == 0
    assert lake.read("solutions").num_rows == 2
    assert findings(lmtr, home) == {}


def test_what_a_lake_holds_is_told(lmtr, home):
    Lake(home.lake).append("segments", segments(0), app_id="g", number=1)
    at = ("--home", home.root, "lake")
    told = json.loads(lmtr(*at, "info", "--format", "json")[1])
    assert {each["table"]: each["rows"] for each in told}["solutions"] == 2
    versions = json.loads(lmtr(*at, "history", "solutions", "--format", "json")[1])
    assert [each["version"] for each in versions] == [2, 1, 0]
    figures = json.loads(lmtr(*at, "stats", "segments", "-c", "x", "--format", "json")[1])
    assert [each["entry"] for each in figures[:2]] == ["height", "roll_pitch[0]"]
    assert [each["mean"] for each in figures] == list(range(TASK_SIZE))
    assert lmtr(*at, "stats", "solutions", "--format", "csv")[1].startswith("column,entry,unit,")
    (row,) = json.loads(lmtr(*at, "sample", "segments", "-n", "1", "--format", "json")[1])
    assert row["x"] == list(range(TASK_SIZE))
    assert "0 files" in lmtr(*at, "vacuum")[1]
    assert "is of schema version 2 already" in lmtr(*at, "migrate")[1]


def test_tables_for_people_show_what_a_terminal_has_room_for(lmtr, home):
    lake = Lake(home.lake)
    rows = segments(0)
    lake.append("segments", rows, app_id="g", number=1)
    at = ("--home", home.root, "lake")
    told = lmtr(*at, "stats", "segments", "-c", "x")[1]
    assert [word.strip() for word in told.splitlines()[1].strip("┃").split("┃")] == [
        *("column", "unit", "count", "min", "q50", "max", "mean", "std")
    ]
    assert "│ x height" in told
    group = Group("segments", {"dataset_id": "a"}, "solution_index")
    Appender(lake, group).append(segments(1), {"lmtr.b": "2", "lmtr.a": "1"})
    assert "a=1, b=2 │" in " ".join(lmtr(*at, "history", "segments", "-n", "1")[1].split())


def test_units_of_entries_follow_their_axes():
    names = dict(entry_names(SEGMENT_LAYOUT))
    assert len(names) == SEGMENT_SIZE
    assert names["base_nodes[0,0,2]"] == "m"
    assert names["base_nodes[0,0,5]"] == "rad"
    assert names["base_nodes[8,1,0]"] == "m/s"
    assert names["base_nodes[8,1,3]"] == "rad/s"
    assert names["LF_forces[1,0,0,2]"] == "N"
    assert names["RH_forces[1,1,1,2]"] == "N/s"
    assert dict(entry_names(TASK_LAYOUT))["next_lines[1,2]"] == "rad"


def test_tables_that_are_not_there_are_told(lmtr, home):
    status, _, err = lmtr("--home", home.root, "lake", "history", "rollouts")
    assert status == 2
    assert "'rollouts' is not there yet; there are: datasets, solutions, cuts" in err
