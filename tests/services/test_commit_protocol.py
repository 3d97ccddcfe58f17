"""The commit protocol: one row for each key, whoever crashes at whatever step in whatever order."""

import itertools
import shutil
import tempfile
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from services.lake.appender import Appender, Group
from services.lake.digest import row_digests, sealed
from services.lake.schemas import SCHEMAS
from services.lake.tables import Lake

GROUP = Group("solutions", {"dataset_id": "a"}, "index")
KEYS = range(10)


def solutions(keys, dataset_id="a"):
    """Rows whose numbers depend on their keys alone."""
    rows = [
        {
            "dataset_id": dataset_id,
            "index": key,
            "status": "converged",
            "accepted": True,
            "reject_reasons": [],
            "cost": 1.5 * key,
            "cost_terms": [("effort", 0.5 * key)],
            "constraint_violation": [],
            "violations": [],
            "base_nodes": [float(key), 0.1 * key],
            "code_version": "0",
            "config_hash": "0",
            "created_at": datetime(2026, 11, 25, tzinfo=UTC),
        }
        for key in keys
    ]
    return sealed("solutions", pa.Table.from_pylist(rows, schema=SCHEMAS["solutions"]))


EXPECTED = dict(zip(KEYS, solutions(KEYS)["digest"].to_pylist(), strict=True))


def found(lake):
    """Digests in the table by key, after checking that each fits its row and comes once."""
    if not lake.exists("solutions"):
        return {}
    rows = lake.read("solutions")
    digests = rows["digest"].to_pylist()
    assert digests == row_digests("solutions", rows)
    keys = rows["index"].to_pylist()
    assert len(set(keys)) == len(keys)
    return dict(zip(keys, digests, strict=True))


class Writer:
    """A writer under way: its appender, the rows it wants in, and what it has prepared of them."""

    def __init__(self, folder):
        self.folder = folder
        self.wanted = None
        self.restart()

    def restart(self):
        self.appender = Appender(Lake(self.folder), GROUP)
        self.prepared = None

    def prepare(self):
        self.prepared, _ = self.appender.prepare(solutions(self.wanted))

    def commit(self):
        prepared, self.prepared = self.prepared, None
        return self.appender.commit(prepared)

    def leave_orphan(self):
        """What a crash between the data file and its log entry leaves."""
        path = Path(self.folder) / "solutions" / f"part-{id(self.prepared)}.parquet"
        pq.write_table(self.prepared.rows, path)


class TwoWriters(RuleBasedStateMachine):
    """Any order of steps, crashes and compactions of two writers of one data set."""

    @initialize()
    def begin(self):
        self.folder = tempfile.mkdtemp()
        self.writers = [Writer(self.folder), Writer(self.folder)]
        self.confirmed = set()
        self.sent = set()

    def teardown(self):
        if not hasattr(self, "folder"):
            return
        Appender(Lake(self.folder), GROUP).append(solutions(KEYS))
        assert found(Lake(self.folder)) == EXPECTED
        shutil.rmtree(self.folder)

    @rule(who=st.integers(0, 1), keys=st.lists(st.sampled_from(KEYS), min_size=1, max_size=5))
    def prepare(self, who, keys):
        writer = self.writers[who]
        writer.wanted = writer.wanted or keys
        self.sent |= set(writer.wanted)
        writer.prepare()

    @rule(who=st.integers(0, 1))
    def commit(self, who):
        writer = self.writers[who]
        if writer.prepared is not None and writer.commit():
            self.confirmed |= set(writer.wanted)
            writer.wanted = None

    @rule(who=st.integers(0, 1), how=st.sampled_from(["before", "between", "after"]))
    def crash(self, who, how):
        """The writer dies and another one is sent the same rows."""
        writer = self.writers[who]
        if writer.prepared is not None and how == "between":
            writer.leave_orphan()
        if writer.prepared is not None and how == "after":
            writer.commit()
        writer.restart()

    @rule()
    def compact(self):
        if Lake(self.folder).exists("solutions"):
            Lake(self.folder).compact("solutions")

    @invariant()
    def every_row_is_there_once(self):
        if not hasattr(self, "folder"):
            return
        rows = found(Lake(self.folder))
        assert self.confirmed <= rows.keys() <= self.sent
        assert all(rows[key] == EXPECTED[key] for key in rows)


TestTwoWriters = TwoWriters.TestCase
TestTwoWriters.settings = settings(
    max_examples=25, stateful_step_count=12, deadline=None, derandomize=True
)


STEPS = sorted(set(itertools.permutations("aabb")))
"""All orders of two steps, prepare and commit, of two writers."""


@pytest.mark.parametrize("crash", [None, *range(4)])
@pytest.mark.parametrize("order", STEPS, ids="".join)
def test_every_interleaving_with_a_crash_at_each_step(tmp_path, order, crash):
    writers = {name: Writer(tmp_path / "lake") for name in "ab"}
    writers["a"].wanted, writers["b"].wanted = [0, 1, 2, 3], [2, 3, 4, 5]
    for step, name in enumerate(order):
        writer = writers[name]
        if step == crash:
            if writer.prepared is not None:
                writer.leave_orphan()
            writer.restart()
        if writer.prepared is None:
            writer.prepare()
        else:
            writer.commit()
    for writer in writers.values():
        writer.appender.append(solutions(writer.wanted))
    assert found(Lake(tmp_path / "lake")) == {key: EXPECTED[key] for key in range(6)}


def test_a_second_writer_is_noticed_and_its_rows_are_left_out(tmp_path):
    one, two = (Appender(Lake(tmp_path / "lake"), GROUP) for _ in range(2))
    first = one.append(solutions([0, 1]))
    assert (first.rows, first.doubled, first.joined) == (2, 0, False)
    second = two.append(solutions([1, 2]))
    assert (second.rows, second.doubled, second.joined) == (1, 1, False)
    third = one.append(solutions([2, 3]))
    assert (third.rows, third.doubled, third.joined) == (1, 1, True)
    fourth = one.append(solutions([4, 4]))
    assert (fourth.rows, fourth.doubled, fourth.joined) == (1, 1, False)
    present, number = one.present()
    assert list(present.missing(range(7))) == [5, 6]
    assert number == 4
    late = Appender(Lake(tmp_path / "lake"), GROUP, since=number - 1)
    assert late.append(solutions([6])).joined is True


def test_groups_do_not_disturb_one_another(tmp_path):
    lake = Lake(tmp_path / "lake")
    other = Group("solutions", {"dataset_id": "b"}, "index")
    one, two = Appender(lake, GROUP), Appender(lake, other)
    for key in range(3):
        assert one.append(solutions([key])).joined is False
        assert two.append(solutions([key], "b")).joined is False
    assert lake.read("solutions").num_rows == 6


def test_all_rows_of_a_key_are_in_or_none(tmp_path, segments):
    rng = np.random.default_rng(0)
    rows = segments(rng.normal(size=(6, 35)), rng.normal(size=(6, 264)))
    at = rows.schema.get_field_index("solution_index")
    rows = rows.set_column(at, rows.schema.field(at), pa.array([0, 0, 1, 1, 2, 2]))
    group = Group(
        "segments", {"dataset_id": "a", "segmentation_id": "cut"}, "solution_index", False
    )
    appender = Appender(Lake(tmp_path / "lake"), group)
    assert appender.append(rows.slice(0, 4)).rows == 4
    again = appender.append(rows)
    assert (again.rows, again.doubled) == (2, 4)


RACER = """
import sys
sys.path.insert(0, sys.argv[2])
from test_commit_protocol import GROUP, solutions
from services.lake.appender import Appender
from services.lake.tables import Lake
appender = Appender(Lake(sys.argv[1]), GROUP)
print("ready", flush=True)
sys.stdin.readline()
for start in range(0, 60, 3):
    appender.append(solutions(range(start, start + 5)))
"""


def test_writers_at_once_leave_one_row_for_each_key(tmp_path, spawn):
    racers = [spawn(RACER, tmp_path / "lake", Path(__file__).parent) for _ in range(3)]
    assert [racer.stdout.readline() for racer in racers] == ["ready\n"] * 3
    for racer in racers:
        racer.stdin.write("go\n")
        racer.stdin.flush()
    for racer in racers:
        racer.communicate(timeout=120)
        assert racer.returncode == 0
    assert sorted(found(Lake(tmp_path / "lake"))) == list(range(62))


COMPACTOR = """
import sys
from services.lake.tables import Lake
print("ready", flush=True)
sys.stdin.readline()
for _ in range(5):
    Lake(sys.argv[1]).compact("solutions")
"""


def test_writers_and_compactions_at_once_lose_nothing(tmp_path, spawn):
    appender = Appender(Lake(tmp_path / "lake"), GROUP)
    for key in KEYS:
        appender.append(solutions([key]))
    others = [spawn(COMPACTOR, tmp_path / "lake") for _ in range(3)]
    assert [other.stdout.readline() for other in others] == ["ready\n"] * 3
    for other in others:
        other.stdin.write("go\n")
        other.stdin.flush()
    for key in range(len(KEYS), 30):
        appender.append(solutions([key]))
    for other in others:
        other.communicate(timeout=120)
        assert other.returncode == 0
    assert sorted(found(Lake(tmp_path / "lake"))) == list(range(30))
