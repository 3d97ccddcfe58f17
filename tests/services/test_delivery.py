"""A delivery line keeps the product of every item, whatever dies or dawdles on the way."""

import collections
import functools
import json
import logging
import os
import signal
import time

import pytest

from services.cluster.batches import Sizer
from services.cluster.delivery import Kept, Made, Order, Rhythm, Trouble
from services.errors import ClusterError, LakeError


def worker(work):
    """A maker whose code needs no import on the other side."""

    class Maker:
        def __call__(self, item):
            return work(item), {"item": item}

        @staticmethod
        def pack(products):
            return [bytes(str(product), "ascii") for product in products]

    return Maker


def squares():
    def make():
        return worker(lambda item: item * item)()

    return make


def kilobytes(work):
    """Makes makers whose products say that they are a kilobyte each."""

    def make():
        class Large(worker(work)):
            @staticmethod
            def pack(products):
                class Payload(list):
                    nbytes = 1000 * len(products)

                return Payload(bytes(str(product), "ascii") for product in products)

        return Large()

    return make


def file_sink(path, before=lambda payloads: None):
    """A sink that adds one line for each commit to a file."""

    def make():
        def keep(payloads, metadata):
            before(payloads)
            products = [int(product) for payload in payloads for product in payload]
            with open(path, "a", encoding="ascii") as file:
                file.write(json.dumps({"products": products, "metadata": dict(metadata)}) + "\n")
            return len(products)

        return keep

    return make


def order(path, items, make_worker=None, **changes):
    return Order(
        make_worker=make_worker or squares(),
        make_sink=changes.pop("make_sink", file_sink(path)),
        items=items,
        total=len(items),
        failed=lambda item, error: ([b"-1"], {"item": item, "error": error}),
        rhythm=changes.pop("rhythm", Rhythm(0.05, commit_items=4, commit_seconds=0.3)),
        **changes,
    )


def kept(path):
    with open(path, encoding="ascii") as file:
        return collections.Counter(p for line in file for p in json.loads(line)["products"])


def notes(events):
    return [note for event in events if isinstance(event, Made) for note in event.notes]


def test_every_item_is_made_noted_and_kept(cluster, tmp_path):
    path = tmp_path / "kept"
    events = list(cluster.deliver(order(path, range(40), describe=lambda: {"by": "me"})))
    assert kept(path) == {k * k: 1 for k in range(40)}
    assert sorted(note["item"] for note in notes(events)) == list(range(40))
    assert sum(event.items for event in events if isinstance(event, Kept)) == 40
    assert json.loads(path.read_text().splitlines()[0])["metadata"] == {"by": "me"}


def test_an_item_that_throws_fails_alone_and_is_kept_as_failed(cluster, tmp_path):
    path = tmp_path / "kept"

    def make():
        def work(item):
            if item == 3:
                raise ValueError("two\nlines")
            return item

        return worker(work)()

    made = notes(cluster.deliver(order(path, range(8), make)))
    assert [note["error"] for note in made if "error" in note] == ["ValueError: two lines"]
    assert kept(path) == {-1: 1, **{k: 1 for k in range(8) if k != 3}}


def test_a_sink_that_refuses_ends_the_line_with_its_own_error(cluster, tmp_path):
    def refuse(payloads):
        raise LakeError("table 'solutions' cannot be written: no space; make room")

    with pytest.raises(LakeError, match="no space; make room"):
        list(cluster.deliver(order(tmp_path / "kept", range(8), make_sink=file_sink("", refuse))))


def test_a_stop_finishes_and_keeps_what_is_under_way(cluster, tmp_path):
    path, seen = tmp_path / "kept", collections.deque()

    def make():
        def work(item):
            time.sleep(0.02)
            return item

        return worker(work)()

    stopping = order(path, range(500), make, stopping=lambda: len(seen) > 5)
    for event in cluster.deliver(stopping):
        seen.extend(notes([event]))
    assert 5 < len(seen) < 500
    assert kept(path) == {note["item"]: 1 for note in seen}


def test_a_worker_that_dies_over_a_batch_costs_nothing(two, tmp_path):
    path, marker = tmp_path / "kept", tmp_path / "killed"

    def make():
        def work(item):
            if item == 20 and not marker.exists():
                marker.touch()
                os.kill(os.getpid(), signal.SIGKILL)
            return item

        return worker(work)()

    events = list(two.deliver(order(path, range(40), make)))
    assert [e.kind for e in events if isinstance(e, Trouble) and e.kind == "worker_died"]
    assert kept(path).keys() == set(range(40))
    assert sorted(note["item"] for note in notes(events)) == list(range(40))


def test_an_item_that_kills_every_worker_fails_alone(two, tmp_path):
    path = tmp_path / "kept"

    def make():
        def work(item):
            if item == 7:
                os.kill(os.getpid(), signal.SIGKILL)
            return item

        return worker(work)()

    made = notes(two.deliver(order(path, range(12), make)))
    (failed,) = (note for note in made if "error" in note)
    assert failed["item"] == 7
    assert "worker died 4 times over it" in failed["error"]
    assert kept(path).keys() == {-1, *range(12)} - {7}


@pytest.mark.parametrize("when", ["before", "after"])
def test_a_writer_that_dies_is_sent_its_commit_again(two, tmp_path, when):
    path, marker = tmp_path / "kept", tmp_path / "killed"

    def die():
        if not marker.exists():
            marker.touch()
            os.kill(os.getpid(), signal.SIGKILL)

    def make():
        inner = file_sink(path)()

        def keep(payloads, metadata):
            if when == "before":
                die()
            receipt = inner(payloads, metadata)
            die()
            return receipt

        return keep

    events = list(two.deliver(order(path, range(12), make_sink=make)))
    assert Trouble("writer_died") in events
    assert sum(event.items for event in events if isinstance(event, Kept)) == 12
    counts = kept(path)
    assert counts.keys() == {k * k for k in range(12)}
    # A commit whose answer was lost comes twice: telling that is the sink's part.
    assert (max(counts.values()) == 2) == (when == "after")


def test_idle_workers_repeat_what_a_slow_one_holds(two, tmp_path, monkeypatch):
    monkeypatch.setattr("services.cluster.ray_line.SLOW_LEAST_S", 0.5)
    path, marker = tmp_path / "kept", tmp_path / "stuck"

    def make():
        def work(item):
            if item == 5 and not marker.exists():
                marker.touch()
                time.sleep(600)
            return item

        return worker(work)()

    events = list(two.deliver(order(path, range(12), make)))
    assert "slow_worker" in [event.kind for event in events if isinstance(event, Trouble)]
    assert kept(path) == dict.fromkeys(range(12), 1)


def test_workers_pause_while_the_writer_is_behind(two, tmp_path):
    started = tmp_path / "started"
    started.mkdir()

    def work(item):
        (started / str(item)).touch()
        return item

    def slow(payloads):
        time.sleep(1.5)

    rhythm = Rhythm(batch_seconds=1e-6, commit_items=1, commit_seconds=0.1, uncommitted_bytes=3000)
    path = tmp_path / "kept"
    changes = {"make_sink": file_sink(path, slow), "rhythm": rhythm}
    stream = two.deliver(order(path, range(30), kilobytes(work), **changes))
    for event in stream:
        if isinstance(event, Kept):
            break
    # What the first commit held, and at most what may wait, with one more under way at each worker.
    assert len(list(started.iterdir())) <= 8
    stream.close()


def test_what_fills_the_room_for_waiting_is_committed_at_once(cluster, tmp_path):
    rhythm = Rhythm(0.05, commit_items=10**6, commit_seconds=3600.0, uncommitted_bytes=4000)
    path = tmp_path / "kept"
    list(cluster.deliver(order(path, range(30), kilobytes(lambda item: item), rhythm=rhythm)))
    assert kept(path) == dict.fromkeys(range(30), 1)


def test_a_product_that_cannot_be_packed_fails_alone(cluster, tmp_path):
    def make():
        class Choosy:
            def __call__(self, item):
                return item, {"item": item}

            @staticmethod
            def pack(products):
                if 37 in products:
                    raise OverflowError("37 is too large")
                return [bytes(str(product), "ascii") for product in products]

        return Choosy()

    path = tmp_path / "kept"
    events = list(cluster.deliver(order(path, range(100), make)))
    assert kept(path) == dict.fromkeys([-1, *(set(range(100)) - {37})], 1)
    assert [note for note in notes(events) if "error" in note] == [
        {"item": 37, "error": "OverflowError: 37 is too large"}
    ]


def test_a_process_in_which_no_worker_can_be_made_costs_no_item(two, tmp_path):
    flag = tmp_path / "sick"

    def make():
        import contextlib
        import os

        with contextlib.suppress(FileExistsError), open(flag, "x") as file:
            file.write(str(os.getpid()))
        if flag.read_text() == str(os.getpid()):
            raise ImportError("no space left on device")
        return worker(lambda item: item)()

    path = tmp_path / "kept"
    events = list(two.deliver(order(path, range(200), make)))
    assert kept(path) == dict.fromkeys(range(200), 1)
    assert not [note for note in notes(events) if "error" in note]


def test_a_worker_that_nowhere_can_be_made_is_an_error_with_its_reason(two, tmp_path):
    def make():
        raise ImportError("no space left on device")

    with pytest.raises(ClusterError, match="no worker can be started: ImportError: no space left"):
        list(two.deliver(order(tmp_path / "kept", range(20), make)))


def test_warnings_of_workers_come_once_and_then_by_count(two, tmp_path, caplog):
    def make():
        def work(item):
            logging.getLogger("solver").warning("item %d took long", item)
            return item

        return worker(work)()

    with caplog.at_level(logging.WARNING, logger="workers"):
        list(two.deliver(order(tmp_path / "kept", range(30), make)))
    said = [record.getMessage() for record in caplog.records if record.name == "workers"]
    assert len(said) == 2
    assert said[0].startswith("a worker says: solver: item")
    assert said[1].startswith("workers said")
    assert "times more: solver: item # took long" in said[1]


def test_warnings_of_the_writer_reach_the_user(cluster, tmp_path, caplog):
    path = tmp_path / "kept"
    keep = file_sink(path)

    def make_sink():
        sink = keep()

        def warn_and_keep(payloads, metadata):
            logging.getLogger("sink").warning("there is something about %s", path.name)
            return sink(payloads, metadata)

        return warn_and_keep

    list(cluster.deliver(order(path, range(3), squares(), make_sink=make_sink)))
    assert "there is something about kept" in caplog.text


def test_batches_fit_the_pace_and_shrink_towards_the_end():
    sizer = Sizer(Rhythm(batch_seconds=2.0), workers=4)
    assert sizer.size("fast", 1000) == 1
    sizer.learn("fast", 1, 0.1)
    sizer.learn("slow", 1, 1.0)
    assert sizer.size("fast", 1000) == 20
    assert sizer.size("slow", 1000) == 2
    assert sizer.size("fast", 8) == 2
    assert sizer.size("fast", 0) == 1
    assert sizer.expected("slow", 3) == pytest.approx(3.0)
    assert sizer.expected("new", 1) == pytest.approx(1.0)


def test_makers_travel_with_arguments(two, tmp_path):
    def make(factor):
        return worker(lambda item: factor * item)()

    path = tmp_path / "kept"
    list(two.deliver(order(path, range(5), functools.partial(make, 3))))
    assert kept(path) == {3 * k: 1 for k in range(5)}
