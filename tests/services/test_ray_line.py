"""What a delivery line decides when batches, their copies and hosts end in an unlucky order."""

import time
from types import SimpleNamespace

import pytest

from services.cluster.batches import BatchReply
from services.cluster.delivery import Made, Order, Rhythm, Trouble
from services.cluster.ray_line import RayLine, _Batch, _Task
from services.cluster.writer import Answer

LONG_AGO = -1000.0


@pytest.fixture
def line():
    """A line with two tasks, A and B, begun and not done; nothing of it runs."""
    order = Order(
        make_worker=None, make_sink=None, items=[], total=2, failed=None, rhythm=Rhythm(0.1)
    )
    made = RayLine(order, 2, lambda: True)
    made._open = {task.number: task for task in (A, B)}
    made._exhausted = True
    return made


A, B = _Task(0, "A"), _Task(1, "B")


def batch(payload, *tasks, repeated=False):
    return _Batch(tasks, f"worker of {payload}", payload, time.monotonic() + LONG_AGO, repeated)


def reply(of):
    notes = tuple({"item": task.item} for task in of.tasks)
    return BatchReply(notes, tuple(range(len(notes))), (), 1.0, 10)


def waiting(line):
    return [
        (parcel.payload, [task.item for task in parcel.items]) for parcel in line._waiting.take()
    ]


def test_products_that_were_lost_are_uncounted_and_come_once_into_the_next_commit(line):
    slow, copy = batch("slow", A, B, repeated=True), batch("copy", A, B)
    (told,) = line._made(copy, reply(copy))
    parcels = line._waiting.take()
    line._writer = SimpleNamespace(settle=lambda _: Answer(None, 0, parcels), nbytes=0)
    (lost,) = line._kept("the host of the copy is gone")
    assert lost == Trouble("host_lost", 2, list(told.notes))
    alone = batch("alone", line._again.popleft())
    assert list(line._made(alone, reply(alone))) == [Made(({"item": "A"},))]
    assert list(line._made(slow, reply(slow))) == []
    assert waiting(line) == [("alone", ["A"])]
    assert {task.item for task in line._again} == {"B"}


def test_a_batch_whose_copy_died_is_copied_again(line):
    stuck = batch("stuck", A, B, repeated=True)
    line._running = {"reference": stuck}
    assert line._slow() is None
    assert list(line._again_or_fail((A, B), "worker_died", "killed")) == [Trouble("worker_died", 0)]
    assert line._slow() is stuck


def test_the_first_of_two_that_hold_the_same_tasks_counts(line):
    first, second = batch("first", A, B), batch("second", A, B)
    assert len(list(line._made(first, reply(first)))) == 1
    assert list(line._made(second, reply(second))) == []
    assert waiting(line) == [("first", ["A", "B"])]
    assert not line._again
