"""After a repair a table is usable, nothing is deleted, and no undamaged row is lost."""

import json
from datetime import timedelta

import numpy as np
import pyarrow as pa
import pytest

from services.errors import LakeError, LostVersionError
from services.lake import repair
from services.lake.inspection import data_files, inspect_table
from services.lake.log import HINT, checkpoint_path, entry_path
from services.lake.maintenance import forgotten
from services.lake.repair import QUARANTINE, repair_table
from services.lake.schemas import SCHEMAS
from services.lake.tables import Lake


def indices(lake):
    return lake.read("solutions", ["index"], order_by="index")["index"].to_pylist()


def is_clean(lake):
    return inspect_table(lake, "solutions").findings == []


def everything(folder):
    """Contents of all files below a folder, whatever they are called."""
    return sorted(path.read_bytes() for path in folder.rglob("*") if path.is_file())


@pytest.fixture
def rows_before(full):
    return full.read("solutions", order_by="index")


def test_a_sound_table_is_left_as_it_is(full, damage):
    before = everything(damage.folder)
    assert not repair_table(full, "solutions").changed
    assert everything(damage.folder) == before


@pytest.mark.parametrize("content", [b"", b'{"commitInfo":{"timest', b"\x00" * 200])
@pytest.mark.parametrize("version", [0, 1, 2, 3])
def test_a_torn_log_entry_costs_no_row(full, damage, rows_before, version, content):
    damage.tear(version, content)
    contents = everything(damage.folder)
    done = repair_table(full, "solutions")
    assert done.version == version - 1
    assert done.log_files == [entry_path(v) for v in range(3, version - 1, -1)]
    assert (done.lost, done.refused) == (0, 0)
    assert full.read("solutions", order_by="index").equals(rows_before)
    assert is_clean(full)
    after = everything(damage.folder)
    assert all(content in after for content in contents)
    assert not repair_table(full, "solutions").changed


def test_after_a_repair_the_table_takes_more_rows(full, damage, solutions):
    damage.tear(2, b"")
    repair_table(full, "solutions")
    assert full.append(
        "solutions", solutions([12]), app_id="x", number=full.next_number("solutions", "x")
    )
    assert indices(full) == list(range(13))


def test_a_checkpoint_newer_than_a_torn_entry_keeps_the_table_as_it_is(full, damage, rows_before):
    full.delta("solutions").create_checkpoint()
    damage.tear(1, b"{")
    done = repair_table(full, "solutions")
    assert done.log_files == [entry_path(1)]
    assert (done.version, done.salvaged) == (3, 0)
    assert full.version("solutions") == 3
    assert full.read("solutions", order_by="index").equals(rows_before)
    assert is_clean(full)


@pytest.mark.parametrize("content", [b"PAR1", b"", None])
def test_a_damaged_or_missing_checkpoint_is_done_without(full, damage, rows_before, content):
    full.delta("solutions").create_checkpoint()
    path = damage.folder / checkpoint_path(3)
    path.write_bytes(content) if content is not None else path.unlink()
    assert json.loads((damage.folder / HINT).read_text())["version"] == 3
    with pytest.raises(LakeError, match=r"cannot be read: .*`lmtr lake check`$"):
        Lake(full.storage).read("solutions")
    done = repair_table(full, "solutions")
    assert HINT in done.log_files
    assert full.read("solutions", order_by="index").equals(rows_before)
    assert is_clean(full)


def test_a_torn_entry_below_a_damaged_checkpoint_falls_back_before_it(full, damage, rows_before):
    full.delta("solutions").create_checkpoint()
    (damage.folder / checkpoint_path(3)).write_bytes(b"PAR1")
    damage.tear(2, b"{")
    assert repair_table(full, "solutions").version == 1
    assert full.read("solutions", order_by="index").equals(rows_before)
    assert is_clean(full)


def test_a_damaged_file_goes_and_its_sound_rows_come_back(full, damage, solutions, put):
    damaged = solutions([20, 21, 22])
    at = damaged.schema.get_field_index("cost")
    put(
        full, "solutions", damaged.set_column(at, damaged.schema.field(at), pa.array([21.0, 0, 23]))
    )
    path = damage.file_with(21)
    done = repair_table(full, "solutions")
    assert list(done.files) == [path.name]
    assert (done.taken_out, done.salvaged, done.refused, done.lost) == (3, 2, 1, 1)
    assert (damage.folder / QUARANTINE / path.name).is_file()
    assert indices(full) == [*range(12), 20, 22]
    assert is_clean(full)
    notes = full.history("solutions")
    assert [each.get("lmtr.repair") for each in notes[:2]] == [
        "rows salvaged from 1 files",
        "files set aside: 1, gone: 0",
    ]


def test_a_flipped_bit_costs_at_most_the_rows_of_its_file(full, damage):
    damage.flip(damage.file_with(5), "force_nodes")
    done = repair_table(full, "solutions")
    assert set(indices(full)) >= {0, 1, 2, 3, 8, 9, 10, 11}
    assert len(indices(full)) == 12 - done.lost
    assert done.lost >= 1
    assert is_clean(full)


def test_truncated_and_missing_files_leave_the_rest(full, damage):
    short, gone = damage.file_with(0), damage.file_with(11)
    short.write_bytes(short.read_bytes()[:-100])
    gone.unlink()
    done = repair_table(full, "solutions")
    assert done.missing == {gone.name: 4}
    assert (done.lost, indices(full)) == (8, [4, 5, 6, 7])
    assert is_clean(full)


def test_a_torn_log_and_a_damaged_file_at_once(full, damage):
    short = damage.file_with(0)
    short.write_bytes(short.read_bytes()[:-100])
    damage.tear(3, b"")
    repair_table(full, "solutions")
    assert indices(full) == list(range(4, 12))
    assert is_clean(full)


def test_what_only_a_killed_writer_left_is_not_taken_in(full, damage, solutions, put, tmp_path):
    other = Lake(tmp_path / "other")
    put(other, "solutions", solutions([50]))
    (stray,) = (other.storage.folder / "solutions").glob("*.parquet")
    stray.rename(damage.folder / stray.name)
    assert not repair_table(full, "solutions").changed
    assert indices(full) == list(range(12))


def test_the_same_row_in_several_files_outside_the_table_is_salvaged_once(full, damage, solutions):
    full.compact("solutions")
    for version in range(full.version("solutions") + 1):
        damage.tear(version, b"")
    for path in (damage.folder / "_delta_log").glob("*checkpoint*"):
        path.unlink()
    done = repair_table(full, "solutions")
    assert (done.version, done.salvaged) == (-1, 12)
    assert indices(full) == list(range(12))


@pytest.mark.parametrize("moved", [0, 1])
def test_a_repair_that_was_killed_is_finished_by_the_next(full, damage, monkeypatch, moved):
    short = damage.file_with(5)
    short.write_bytes(short.read_bytes()[:-100])
    damage.tear(2, b"{")
    set_aside, calls = repair._set_aside, iter(range(99))

    def killed(files, path):
        if next(calls) == moved:
            raise KeyboardInterrupt
        set_aside(files, path)

    with monkeypatch.context() as patch:
        patch.setattr(repair, "_set_aside", killed)
        with pytest.raises(KeyboardInterrupt):
            repair_table(full, "solutions")
    repair_table(full, "solutions")
    assert indices(full) == [0, 1, 2, 3, 8, 9, 10, 11]
    assert is_clean(full)


def test_a_repair_killed_before_rows_come_back_brings_them_back_later(
    full, damage, solutions, put, monkeypatch
):
    damaged = solutions([20, 21])
    at = damaged.schema.get_field_index("cost")
    put(full, "solutions", damaged.set_column(at, damaged.schema.field(at), pa.array([21.0, 0])))

    def killed(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(repair, "_bring_back", killed)
        with pytest.raises(KeyboardInterrupt):
            repair_table(full, "solutions")
    assert indices(full) == list(range(12))
    assert repair_table(full, "solutions").salvaged == 1
    assert indices(full) == [*range(12), 20]


def test_trying_it_out_changes_nothing(full, damage):
    gone = damage.file_with(11)
    gone.unlink()
    before = everything(damage.folder)
    assert repair_table(full, "solutions", dry_run=True).missing == {gone.name: 4}
    damage.tear(3, b"")
    before = everything(damage.folder)
    done = repair_table(full, "solutions", dry_run=True)
    assert (done.log_files, done.version) == ([entry_path(3)], 2)
    assert everything(damage.folder) == before


def test_tables_without_digests_are_salvaged_by_their_rules(lake, datasets):
    for number, name in enumerate("abc", start=1):
        lake.append("datasets", datasets([name]), app_id="x", number=number)
    (lake.storage.folder / "datasets" / entry_path(2)).write_bytes(b"{")
    done = repair_table(lake, "datasets")
    assert done.salvaged == 2
    assert lake.read("datasets").schema.equals(SCHEMAS["datasets"])
    assert sorted(lake.read("datasets")["dataset_id"].to_pylist()) == ["a", "b", "c"]


@pytest.mark.parametrize("torn", [True, False])
def test_what_describes_itself_again_after_a_repair_is_there_once(lake, datasets, torn):
    for name in "abc":
        lake.append_rows("datasets", datasets([name]).to_pylist(), app_id=f"datasets/{name}")
    if torn:
        (lake.storage.folder / "datasets" / entry_path(3)).write_bytes(b"{")
    else:
        (file,) = {f.path for f in data_files(lake.delta("datasets"))} - {
            f.path for f in data_files(lake.delta("datasets", 2))
        }
        (lake.storage.folder / "datasets" / file).unlink()
    assert repair_table(lake, "datasets").lost == (0 if torn else 1)
    for name in "abc":
        lake.append_rows("datasets", datasets([name]).to_pylist(), app_id=f"datasets/{name}")
    assert sorted(lake.values("datasets", "dataset_id")) == ["a", "b", "c"]


@pytest.mark.parametrize(("torn", "content"), [(0, b""), (2, b"{"), (3, b"")])
def test_no_other_rows_come_under_the_number_of_a_lost_version(
    full, damage, solutions, torn, content
):
    before = {
        v: sorted(full.read("solutions", ["index"], version=v)["index"].to_pylist())
        for v in range(torn)
    }
    damage.tear(torn, content)
    assert repair_table(full, "solutions").lost_until == 3
    full.append("solutions", solutions([12]), app_id="y", number=1)
    assert full.version("solutions") > 4
    for version, rows in before.items():
        found = full.read("solutions", ["index"], version=version)["index"].to_pylist()
        assert sorted(found) == rows
    for version in range(torn, 4):
        for read in (full.read, full.delta):
            with pytest.raises(LostVersionError, match=f"version {version} is lost"):
                read("solutions", version=version)
    for version in range(4, full.version("solutions") + 1):
        full.read("solutions", version=version)
    assert is_clean(full)
    assert not repair_table(full, "solutions").changed


def test_the_version_after_a_repair_may_be_named(full, damage):
    damage.tear(3, b"")
    repair_table(full, "solutions")
    pin = full.version("solutions")
    assert full.read("solutions", version=pin).num_rows == 12


def test_versions_below_a_checkpoint_are_lost_with_a_torn_entry_before_them(full, damage):
    full.delta("solutions").create_checkpoint()
    damage.tear(1, b"{")
    repair_table(full, "solutions")
    for version in (1, 2):
        with pytest.raises(LostVersionError, match=f"version {version} is lost"):
            full.delta("solutions", version)
    assert full.read("solutions", version=3).num_rows == 12
    assert full.read("solutions", version=0).num_rows == 0


def test_a_repair_killed_while_it_takes_numbers_takes_the_rest_later(full, damage, monkeypatch):
    damage.tear(1, b"")
    commit, calls = repair.commit_nothing, iter(range(99))

    def killed(*arguments):
        if next(calls) == 1:
            raise KeyboardInterrupt
        commit(*arguments)

    with monkeypatch.context() as patch:
        patch.setattr(repair, "commit_nothing", killed)
        with pytest.raises(KeyboardInterrupt):
            repair_table(full, "solutions")
    assert repair_table(full, "solutions").salvaged == 12
    for version in (1, 2, 3):
        with pytest.raises(LostVersionError):
            full.delta("solutions", version)
    assert full.read("solutions", version=full.version("solutions")).num_rows == 12


def test_a_version_that_is_lost_keeps_no_vacuum_from_its_work(lake, segments):
    for number in (1, 2):
        rows = segments(np.ones((2, 35)), np.ones((2, 264)))
        lake.append("segments", rows, app_id="x", number=number)
    model = {field.name: None for field in SCHEMAS["models"]} | {"segments_version": 2}
    texts = [f.name for f in SCHEMAS["models"] if pa.types.is_string(f.type)]
    numbers = {"seed": 0, "latent": 0, "metrics": [], "created_at": 0}
    lake.append_rows("models", [model | dict.fromkeys(texts, "") | numbers], app_id="m")
    (lake.storage.folder / "segments" / entry_path(2)).write_bytes(b"")
    repair_table(lake, "segments")
    assert len(forgotten(lake, "segments", timedelta(0))) == 1
