"""Whatever is wrong with a table is found and named, and the rest is still looked at."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from services.lake.digest import sealed
from services.lake.inspection import data_files, inspect_table, tables_found
from services.lake.log import entry_path
from services.lake.rules import MAY_BE_NAN, RULES
from services.lake.schemas import FINITE, SCHEMAS


def kinds(inspection):
    return {finding.kind: finding for finding in inspection.findings}


def test_a_sound_table_has_no_findings(full):
    steps = []
    found = inspect_table(full, "solutions", advance=steps.append)
    assert found.findings == []
    assert (found.rows, found.undigested, sum(steps)) == (12, 0, 12)
    assert len(found.readable) == 3


def test_rules_speak_of_columns_that_are_there():
    assert RULES.keys() == SCHEMAS.keys()
    for table, columns in MAY_BE_NAN.items():
        assert set(columns) <= set(SCHEMAS[table].names)
        assert not set(columns) & set(FINITE.get(table, ()))


@pytest.mark.parametrize("table", SCHEMAS)
def test_every_rule_can_be_asked(lake, table):
    lake.append(table, SCHEMAS[table].empty_table(), app_id="x", number=1)
    assert inspect_table(lake, table).findings == []


def test_a_flipped_bit_is_found_with_its_rows_or_its_file(full, damage):
    path = damage.file_with(5)
    damage.flip(path, "force_nodes")
    found = inspect_table(full, "solutions")
    assert list(found.damaged) == [path.name]
    assert path.name in kinds(found)["file"].subjects[0]
    assert found.rows >= 8
    if "digest" in kinds(found):
        assert all("dataset_id=a, index=" in each for each in kinds(found)["digest"].subjects)


def test_numbers_that_changed_behind_a_digest_are_named_by_row(lake, solutions, put):
    rows = solutions([1, 2, 3])
    costs = rows.schema.get_field_index("cost")
    put(lake, "solutions", rows.set_column(costs, rows.schema.field("cost"), pa.array([2.0, 9, 4])))
    found = inspect_table(lake, "solutions")
    assert kinds(found)["digest"].subjects == ["dataset_id=a, index=2"]
    assert "digests belie" in kinds(found)["file"].subjects[0]


def test_a_truncated_and_a_missing_file_do_not_hide_the_others(full, damage):
    short, gone = damage.file_with(0), damage.file_with(11)
    short.write_bytes(short.read_bytes()[:1000])
    gone.unlink()
    found = inspect_table(full, "solutions")
    assert list(found.damaged) == [short.name]
    assert found.damaged[short.name].startswith("cannot be read")
    assert found.missing == {gone.name: 4}
    assert found.rows == 4


@pytest.mark.parametrize("content", [b"", b'{"commitInfo":{"timest'])
@pytest.mark.parametrize("version", [0, 2, 3])
def test_a_torn_log_entry_is_named(full, damage, content, version):
    damage.tear(version, content)
    found = kinds(inspect_table(full, "solutions"))
    assert found["log"].count == 1
    assert entry_path(version) in found["log"].subjects[0]


def test_a_gap_in_the_log_is_named_unless_a_checkpoint_covers_it(full, damage):
    gap = damage.folder / entry_path(2)
    content = gap.read_bytes()
    gap.unlink()
    found = kinds(inspect_table(full, "solutions"))
    assert f"{entry_path(2)} is missing" in found["log"].subjects[0]
    gap.write_bytes(content)
    full.delta("solutions").create_checkpoint()
    gap.unlink()
    assert inspect_table(full, "solutions").findings == []


def test_rows_that_are_there_twice_are_named_with_their_number(full, solutions):
    full.append("solutions", solutions([5, 20, 7]), app_id="twice", number=1)
    found = kinds(inspect_table(full, "solutions"))["identity"]
    assert found.count == 2
    assert found.subjects == [f"dataset_id=a, index={k} (2 times)" for k in (5, 7)]


@pytest.mark.parametrize(
    ("changes", "kind", "says"),
    [
        ({"base_nodes": [np.nan] * 48}, "finite", "base_nodes is finite"),
        ({"expected_cost": np.inf}, "finite", "expected_cost is finite"),
        ({"footholds": [0.0] * 35}, "length", "footholds holds 12 * n_stances values"),
        ({"swing_nodes": []}, "length", "swing_nodes holds 20 * (n_stances - 1) values"),
        ({"start_feet": [0.0] * 7}, "length", "start_feet holds 8 values"),
        ({"base_nodes": [0.0] * 47}, "length", "base_nodes holds a multiple of 12 values"),
        ({"contact_times": [3.0, 2, 1, 0, 0, 0] * 4}, "range", "contact_times of each foot ascend"),
        ({"status": "fine"}, "range", "status is one of converged, "),
        ({"iterations": -1}, "range", "iterations is at least 0"),
        ({"reject_reasons": ["cost"]}, "range", "accepted rows have no reject_reasons"),
        ({"gait_order": [0, 1, 2, 2]}, "range", "gait_order names each foot once"),
        ({"cost": np.nan}, "range", "accepted rows have a trajectory and a finite cost"),
    ],
)
def test_a_row_that_cannot_be_is_named_with_what_it_breaks(full, solutions, changes, kind, says):
    full.append("solutions", solutions([27], **changes), app_id="bad", number=1)
    found = inspect_table(full, "solutions")
    broken = [each for each in found.findings if each.says.startswith(says)]
    assert [each.kind for each in broken] == [kind]
    assert broken[0].subjects == ["dataset_id=a, index=27"]
    assert found.damaged == {}  # the file is whole, only its row is not


def test_nulls_where_none_may_be_are_named(lake, solutions, put):
    rows = solutions([1, 2]).cast(pa.schema([f.with_nullable(True) for f in SCHEMAS["solutions"]]))
    at = rows.schema.get_field_index("config_hash")
    holed = rows.set_column(at, rows.schema.field(at), pa.array(["0", None]))
    put(lake, "solutions", solutions([1, 2]))
    (file,) = data_files(lake.delta("solutions"))
    pq.write_table(holed, lake.storage.folder / "solutions" / file.path)
    found = kinds(inspect_table(lake, "solutions"))
    assert found["null"].subjects == ["dataset_id=a, index=2"]


def test_vectors_of_another_length_and_segments_out_of_time_are_named(lake, segments, put):
    rows = segments(np.zeros((3, 35)), np.zeros((3, 264))).drop_columns(["digest"])
    short = pa.array([[0.0] * 35, [0.0] * 34, [0.0] * 35], pa.list_(pa.float32()))
    rows = rows.set_column(rows.schema.get_field_index("x"), "x", short)
    late = rows.schema.get_field_index("goal_time_s")
    rows = rows.set_column(late, rows.schema.field(late), pa.array([3.0, 3.0, 0.5]))
    put(lake, "segments", sealed("segments", rows))
    found = {each.says: each.subjects for each in inspect_table(lake, "segments").findings}
    assert found.keys() == {"x holds 35 values", "goal_time_s lies after epoch_s"}
    assert "solution_index=1" in found["x holds 35 values"][0]
    assert "solution_index=2" in found["goal_time_s lies after epoch_s"][0]


def test_so_many_bad_rows_are_counted_and_only_some_named(lake, solutions):
    lake.append("solutions", solutions(list(range(30)), cost=np.nan), app_id="x", number=1)
    (finding,) = inspect_table(lake, "solutions", most=4).findings
    assert (finding.count, len(finding.subjects)) == (30, 4)


def test_an_unreadable_table_is_a_finding_and_still_found(full, damage):
    for version in range(4):
        damage.tear(version, b"{")
    found = kinds(inspect_table(full, "solutions"))
    assert found["log"].count == 4
    assert found["table"].subjects == ["not before its log is mended"]
    assert tables_found(full) == ["solutions"]


def test_rows_from_before_digests_are_counted(lake, segments, put):
    rows = segments(np.zeros((3, 35)), np.zeros((3, 264)))
    at = rows.schema.get_field_index("digest")
    put(lake, "segments", rows.set_column(at, rows.schema.field(at), pa.nulls(3, pa.string())))
    found = inspect_table(lake, "segments")
    assert (found.findings, found.undigested) == ([], 3)
