"""``lmtr lake`` as it is typed at a home that was damaged: found, mended, made again as it was."""

import shutil
from contextlib import suppress

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from services.home import Home
from services.lake.digest import COLUMN, row_digests
from services.lake.schemas import SCHEMAS
from services.lake.tables import Lake

ROWS = {
    "solutions": 'SELECT "index", digest FROM solutions ORDER BY ALL',
    "segments": "SELECT solution_index, epoch_s, goal_time_s, digest FROM segments ORDER BY ALL",
}

FEW_ROWS = 3
"""Rows that a changed byte may spoil: a value that several share is stored once."""


@pytest.fixture
def home(cut_home, tmp_path):
    return shutil.copytree(cut_home, tmp_path / "home")


@pytest.fixture
def at(lmtr, home, tiny_config):
    """Types a command at the home: its status, and all that it printed."""

    def typed(*words):
        settings = () if words[0] in ("lake", "query") else ("-c", tiny_config)
        status, out, err = lmtr("--home", home, *words, *settings)
        return status, out + err

    return typed


def data_file(home, table):
    (path,) = Lake(home / "lake").delta(table).get_add_actions(flatten=True)["path"].to_pylist()
    return home / "lake" / table / path


def flip_a_byte(path, table):
    """Change a byte so that numbers of few rows are others, and the file can still be read.

    Returns:
        How many rows.
    """
    content = path.read_bytes()
    for at in range(len(content) // 2, len(content), 101):
        flipped = bytearray(content)
        flipped[at] ^= 0xFF
        with suppress(pa.ArrowException, OSError):
            rows = pq.read_table(pa.BufferReader(bytes(flipped))).cast(SCHEMAS[table])
            belied = zip(row_digests(table, rows), rows[COLUMN].to_pylist(), strict=True)
            count = sum(digest != recorded for digest, recorded in belied)
            if 0 < count <= FEW_ROWS:
                path.write_bytes(flipped)
                return count
    return pytest.fail("no byte changes few rows alone")


def contents(home):
    """Every file below the lake, and what is in it."""
    files = (path for path in (home / "lake").rglob("*") if path.is_file())
    return {path.relative_to(home): path.read_bytes() for path in files}


def require_as_before(lmtr, at, cut_home):
    """Nothing is wrong, and all rows are those of the home that was never damaged."""
    status, told = at("lake", "check")
    assert (status, "nothing is wrong" in told) == (0, True), told
    for sql in ROWS.values():
        before = lmtr("--home", cut_home, "query", sql, "--format", "csv")[1]
        assert at("query", sql, "--format", "csv") == (0, before)


def test_a_flipped_byte_costs_its_rows_until_they_are_made_again(lmtr, at, home, cut_home):
    path = data_file(home, "solutions")
    count = flip_a_byte(path, "solutions")
    status, told = at("lake", "check")
    assert status == 1
    assert f"{path.name} holds rows that their digests belie" in told
    assert "its numbers have its digest\n    dataset_id=" in told
    damaged = contents(home)
    status, told = at("lake", "repair", "--dry-run")
    assert status == 0
    assert f"{path.name} would go to _quarantine/" in told
    assert contents(home) == damaged
    assert f"salvaged, {count} lost" in at("lake", "repair")[1]
    assert f": {count} solved in" in at("generate")[1]
    require_as_before(lmtr, at, cut_home)
    assert set(at("lake", "repair")[1].splitlines()) == {
        f"{table}: nothing to repair" for table in ("datasets", "solutions", "cuts", "segments")
    }


def test_segments_of_a_solution_are_salvaged_all_or_none(lmtr, at, home, cut_home):
    """Cutting goes on where a solution has no segment, so a rest would never be completed."""
    flip_a_byte(data_file(home, "segments"), "segments")
    assert at("lake", "check")[0] == 1
    status, told = at("lake", "repair")
    assert status == 0
    assert "0 rows salvaged" in told
    assert "lmtr segment" in told
    assert "0 new segments" not in at("segment")[1]
    require_as_before(lmtr, at, cut_home)


def test_a_deleted_file_is_made_again(lmtr, at, home, cut_home):
    path = data_file(home, "segments")
    path.unlink()
    for command in (("lake", "info"), ("segment",)):
        status, told = at(*command)
        assert status == 2
        assert path.name in told
        assert told.strip().endswith("`lmtr lake check`")
    status, told = at("lake", "check")
    assert status == 1
    assert f"every data file is there\n    {path.name}\n  mend: run `lmtr lake repair`" in told
    assert f"segments: {path.name} is gone, with " in at("lake", "repair")[1]
    assert at("segment")[0] == 0
    require_as_before(lmtr, at, cut_home)


def test_descriptions_that_were_lost_are_written_again(lmtr, at, home, cut_home):
    for table in ("datasets", "cuts"):
        data_file(home, table).unlink()
    assert at("lake", "repair")[0] == 0
    status, told = at("lake", "check")
    assert status == 1
    assert "its data set is in table datasets" in told
    assert at("lake", "repair", "datasets")[1] == "datasets: nothing to repair\n"
    status, told = at("query", "SELECT count(*) AS n FROM datasets", "--format", "csv")
    assert told == "n\n0\n"
    assert lmtr("--home", home, "segment")[2].startswith("lmtr: this home describes no data set")
    assert at("generate")[0] == at("segment")[0] == 0
    require_as_before(lmtr, at, cut_home)


def test_rollouts_and_models_that_were_lost_are_made_again(lmtr, tiny_home, tiny_config, tmp_path):
    home = shutil.copytree(tiny_home, tmp_path / "home")
    lake, at = Lake(home / "lake"), ("--home", home)
    before = {table: lake.read(table).num_rows for table in ("models", "evaluations", "rollouts")}
    for table in ("models", "rollouts"):
        assert lake.compact(table)
        data_file(home, table).unlink()
    assert lmtr(*at, "lake", "repair")[0] == 0
    for stage in ("train", "evaluate"):
        assert lmtr(*at, stage, "-c", tiny_config)[0] == 0
    assert {table: lake.read(table).num_rows for table in before} == before
    assert lmtr(*at, "lake", "check")[0] == 0


HOLDER = """
import sys
from pipelines import turns
from services.home import Home
home, name = Home.open(sys.argv[1], create=False), sys.argv[2]
with turns.alone(home, name) if name in turns.ALONE else turns.beside_others(home, name):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def busy(spawn, home):
    """Starts a process that holds a lock of the home; gives its id."""
    holders = []

    def hold(name):
        holder = spawn(HOLDER, home, name)
        holders.append(holder)
        assert holder.stdout.readline() == "held\n"
        return holder.pid

    yield hold
    for holder in holders:
        holder.communicate()


def test_a_generation_keeps_repairs_out(at, busy, home):
    process = busy("generate-other-s1-0")
    held = f"`lmtr generate` (process {process}, generate-other-s1-0) is at work; wait until it"
    before = contents(home)
    for command in (("repair",), ("vacuum", "--grace", "0"), ("vacuum", "--forget-history", "-y")):
        status, told = at("lake", *command)
        assert (status, held in told) == (2, True), told
        assert f"run `lmtr lake {command[0]}` again" in told
    assert contents(home) == before
    for command in ("check", "vacuum", "compact", "migrate"):
        assert at("lake", command)[0] == 0
    assert f"at work now: `lmtr generate` (process {process}" in at("lake", "check")[1]


def test_a_repair_keeps_stages_out(at, busy, home):
    process = busy("lake-repair")
    for command in (("generate", "--solutions", "7"), ("segment",), ("lake", "compact")):
        status, told = at(*command)
        assert status == 2
        assert f"`lmtr lake repair` (process {process}) is at work; wait until it is done" in told
    assert f"process {process} is busy with 'lake-repair'" in at("lake", "repair")[1]
    assert f"at work now: `lmtr lake repair` (process {process})" in at("lake", "check")[1]
    assert not [each for each in Home.open(home, create=False).locks.holders() if not each.process]
