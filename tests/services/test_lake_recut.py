"""Rows that are made together are there whole or not at all after a repair."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from deltalake import Transaction

from services.lake import recut, repair
from services.lake.appender import Appender, Group
from services.lake.digest import sealed
from services.lake.inspection import data_files, inspect_table
from services.lake.log import entry_path
from services.lake.queries import query
from services.lake.repair import repair_table

EACH = 10
"""Segments of a solution."""


@pytest.fixture
def cut(segments):
    """Makes all segments of solutions of a data set."""

    def make(solutions, dataset_id="a"):
        rng = np.random.default_rng(0)
        count = EACH * len(solutions)
        rows = segments(rng.normal(size=(count, 35)), rng.normal(size=(count, 264)))
        names = {
            "dataset_id": pa.array([dataset_id] * count),
            "solution_index": pa.array(np.repeat(solutions, EACH)),
        }
        for name, values in names.items():
            rows = rows.set_column(rows.schema.get_field_index(name), name, values)
        return sealed("segments", rows.drop_columns(["digest"]))

    return make


def append(lake, rows):
    """Append as `lmtr segment` does; returns the solutions that it had to cut."""
    group = Group(
        "segments",
        {"dataset_id": rows["dataset_id"][0].as_py(), "segmentation_id": "cut"},
        "solution_index",
        unique=False,
    )
    appender = Appender(lake, group)
    missing = list(appender.present()[0].missing(sorted(set(rows["solution_index"].to_pylist()))))
    appender.append(rows)
    return missing


def counts(lake):
    """Rows of each solution of each data set."""
    sql = "SELECT dataset_id, solution_index, count(*) AS n FROM segments GROUP BY ALL ORDER BY ALL"
    return [tuple(row.values()) for row in query(lake, sql).to_pylist()]


def files_of(lake):
    return [lake.storage.folder / "segments" / f.path for f in data_files(lake.delta("segments"))]


def spoil(path, row):
    """Change a number of one row, whatever its digest says."""
    rows = pq.read_table(path)
    epochs = rows["epoch_s"].to_pylist()
    epochs[row] += 1e-3
    at = rows.schema.get_field_index("epoch_s")
    pq.write_table(rows.set_column(at, rows.schema.field(at), pa.array(epochs)), path)


def is_clean(lake):
    return inspect_table(lake, "segments").findings == []


def test_a_damaged_row_takes_its_solution_with_it(lake, cut):
    first, second = cut([0, 1, 2, 3]), cut([4, 5])
    append(lake, first)
    append(lake, second)
    spoil(next(path for path in files_of(lake) if pq.read_metadata(path).num_rows == 40), 25)
    done = repair_table(lake, "segments")
    assert (done.lost, done.salvaged, done.recut) == (40, 0, 0)
    assert counts(lake) == [("a", 4, EACH), ("a", 5, EACH)]
    assert is_clean(lake)
    assert not repair_table(lake, "segments").changed
    assert append(lake, first) == [0, 1, 2, 3]
    assert counts(lake) == [("a", index, EACH) for index in range(6)]
    assert not repair_table(lake, "segments").changed
    assert is_clean(lake)


def split(lake, rows, at):
    """Leave a table as a compaction might: a solution's rows in two files."""
    append(lake, rows)
    lake.delete("segments", "true")
    for part in (rows.slice(0, at), rows.slice(at)):
        lake.commit(
            "segments",
            lake.delta("segments"),
            part,
            Transaction("compaction", lake.next_number("segments", "compaction")),
        )


def test_a_lost_file_takes_the_rest_of_the_solutions_that_it_may_have_held(lake, cut):
    rows = cut([0, 1, 2, 3])
    split(lake, rows, 25)
    append(lake, cut([2], "other"))
    append(lake, cut([9]))
    next(path for path in files_of(lake) if pq.read_metadata(path).num_rows == 15).unlink()
    done = repair_table(lake, "segments")
    assert (done.lost, done.recut) == (15, 5)
    assert counts(lake) == [("a", 0, EACH), ("a", 1, EACH), ("a", 9, EACH), ("other", 2, EACH)]
    assert append(lake, rows) == [2, 3]
    assert counts(lake)[:4] == [("a", index, EACH) for index in range(4)]
    assert is_clean(lake)


@pytest.mark.parametrize("killed", ["take_out", "commit_nothing"])
def test_a_repair_killed_before_it_took_them_out_does_it_later(lake, cut, monkeypatch, killed):
    rows = cut([0, 1, 2, 3])
    split(lake, rows, 25)
    files_of(lake)[0].write_bytes(b"")

    def kill(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(repair if killed == "take_out" else recut, killed, kill)
        with pytest.raises(KeyboardInterrupt):
            repair_table(lake, "segments")
    repair_table(lake, "segments")
    assert all(count == EACH for *_, count in counts(lake))
    assert not repair_table(lake, "segments").changed
    append(lake, rows)
    assert counts(lake) == [("a", index, EACH) for index in range(4)]


def test_a_lost_taking_out_is_done_again(lake, cut):
    rows = cut([0, 1, 2, 3])
    split(lake, rows, 25)
    files_of(lake)[0].unlink()
    repair_table(lake, "segments")
    append(lake, rows)
    log = lake.storage.folder / "segments"
    noted = next(v for v in range(99) if recut.PENDING in (log / entry_path(v)).read_text())
    (log / entry_path(noted + 1)).write_bytes(b"{")
    done = repair_table(lake, "segments")
    assert (done.version, done.salvaged) == (noted, 0)
    assert all(count == EACH for *_, count in counts(lake))
    append(lake, rows)
    assert counts(lake) == [("a", index, EACH) for index in range(4)]
    assert is_clean(lake)


def test_after_a_torn_log_what_was_added_since_is_made_again(lake, cut):
    for index in range(3):
        append(lake, cut([index]))
    (lake.storage.folder / "segments" / entry_path(2)).write_bytes(b"")
    assert repair_table(lake, "segments").recut == 0
    assert counts(lake) == [("a", 0, EACH)]
    assert append(lake, cut([0, 1, 2])) == [1, 2]
    assert counts(lake) == [("a", index, EACH) for index in range(3)]


def test_a_gap_below_a_checkpoint_is_no_hindrance(lake, cut):
    for index in range(3):
        append(lake, cut([index]))
    lake.delta("segments").create_checkpoint()
    (lake.storage.folder / "segments" / entry_path(1)).write_bytes(b"{")
    files_of(lake)[0].unlink()
    assert repair_table(lake, "segments").lost == EACH
    assert len(counts(lake)) == 2
    assert len(append(lake, cut([0, 1, 2]))) == 1
    assert counts(lake) == [("a", index, EACH) for index in range(3)]
