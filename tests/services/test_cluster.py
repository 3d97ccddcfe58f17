"""Clusters: every item comes back exactly once, whatever happens to workers and consumers."""

import itertools
import os
import pickle
import signal
import stat
import sys
import threading
import time
import types
from pathlib import Path

import pytest
import ray
from ray._private import worker

from services.cluster import Cluster, Failure
from services.errors import ClusterError


@pytest.fixture(scope="module")
def ray_on_this_machine():
    # No test may change what other Ray clusters of this user accept.
    token = os.path.expanduser("~/.ray/auth_token")
    before = os.path.exists(token)
    with Cluster.connect(workers=2) as cluster:
        yield cluster
    assert os.path.exists(token) == before


def squaring():
    """Workers whose code needs no import on the other side."""

    class Squarer:
        def __call__(self, item):
            if item == "bad":
                raise ValueError("two\nlines")
            return item * item

    return Squarer


def wait_until_gone(pids):
    deadline = time.monotonic() + 20.0
    alive = set(pids)
    while alive and time.monotonic() < deadline:
        alive = {pid for pid in alive if os.path.exists(f"/proc/{pid}/cmdline") and _runs(pid)}
        time.sleep(0.05)
    return alive


def _runs(pid):
    try:
        with open(f"/proc/{pid}/stat", encoding="ascii") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_other_users_of_the_machine_reach_no_folder_of_ray(two):
    session = Path(worker._global_node.get_session_dir_path())
    assert session.stat().st_mode & stat.S_IWOTH  # Ray's own choice, which is why
    assert any(folder.stat().st_mode & 0o077 == 0 for folder in session.parents)


def test_every_item_comes_back_once_whatever_the_number_of_workers(two):
    with Cluster.connect(workers=0) as here:
        in_order = [(outcome.item, outcome.value) for outcome in here.stream(squaring(), range(25))]
    assert in_order == [(k, k * k) for k in range(25)]
    for bound in (1, None):
        stream = two.stream(squaring(), range(25), in_flight=bound)
        assert sorted((outcome.item, outcome.value) for outcome in stream) == in_order


def test_no_items_need_no_workers(cluster):
    assert list(cluster.stream(squaring(), [])) == []


def test_an_exception_is_data_in_one_line(cluster):
    outcomes = {outcome.item: outcome for outcome in cluster.stream(squaring(), [2, "bad", 3])}
    assert outcomes[2].value == 4
    assert outcomes[3].value == 9
    bad = outcomes["bad"]
    assert (bad.error, bad.failure) == ("ValueError: two lines", Failure.EXCEPTION)
    assert "raise ValueError" in bad.traceback
    with pytest.raises(ClusterError, match="item 'bad' has no value: ValueError: two lines"):
        _ = bad.value


def test_a_worker_that_cannot_be_made_fails_each_item_with_its_reason():
    def broken():
        raise RuntimeError("no compiler")

    with Cluster.connect(workers=0) as cluster:
        errors = [outcome.error for outcome in cluster.stream(broken, range(3))]
    assert errors == ["RuntimeError: no compiler"] * 3


def test_items_are_taken_only_when_a_worker_is_free(cluster):
    taken = []

    def endless():
        for item in itertools.count():
            taken.append(item)
            yield item

    stream = cluster.stream(squaring(), endless())
    for _ in range(5):
        next(stream)
    time.sleep(0.2)
    assert len(taken) <= 5 + 2
    stream.close()


def test_a_worker_goes_on_while_its_last_outcome_is_being_kept(two, tmp_path):
    def make():
        return lambda item: (tmp_path / str(item)).touch()

    stream = two.stream(make, range(9), in_flight=1)
    assert next(stream).item == 0
    patience = time.monotonic() + 60.0
    while not (tmp_path / "1").exists() and time.monotonic() < patience:
        time.sleep(0.02)
    assert (tmp_path / "1").exists()
    assert not (tmp_path / "2").exists()  # one item, no more
    stream.close()


def test_items_that_break_off_do_not_take_what_is_done_with_them(two):
    def items():
        yield 3
        raise OSError("no more")

    stream = two.stream(squaring(), items(), in_flight=1)
    assert next(stream).value == 9
    with pytest.raises(OSError, match="no more"):
        next(stream)


def test_two_workers_are_two_single_threaded_processes_made_once(two, tmp_path):
    def make():
        calls = itertools.count()

        def work(item):
            # The first to come waits for the other, however slowly that starts.
            (tmp_path / str(os.getpid())).touch()
            patience = time.monotonic() + 60.0
            while len(list(tmp_path.iterdir())) < 2 and time.monotonic() < patience:
                time.sleep(0.02)
            names = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
            return os.getpid(), next(calls), [os.environ[name] for name in names]

        return work

    values = [outcome.value for outcome in two.stream(make, range(20))]
    pids = {pid for pid, _, _ in values}
    assert len(pids) == 2
    assert os.getpid() not in pids
    for pid in pids:
        calls = [call for other, call, _ in values if other == pid]
        assert sorted(calls) == list(range(len(calls)))
    assert all(threads == ["1", "1", "1"] for _, _, threads in values)


def test_an_item_whose_worker_is_killed_once_is_tried_again(two, tmp_path):
    marker = tmp_path / "killed"

    def make():
        def work(item):
            if item == 3 and not marker.exists():
                marker.touch()
                os.kill(os.getpid(), signal.SIGKILL)
            return item

        return work

    outcomes = list(two.stream(make, range(10)))
    assert marker.exists()
    assert sorted(outcome.value for outcome in outcomes) == list(range(10))


def test_an_item_that_kills_every_worker_is_given_up_and_the_others_complete(two, tmp_path):
    tries = tmp_path / "tries"

    def make():
        def work(item):
            if item == 0:
                with tries.open("a") as file:
                    file.write("x")
                os.kill(os.getpid(), signal.SIGKILL)
            return item

        return work

    outcomes = {outcome.item: outcome for outcome in two.stream(make, range(8))}
    assert outcomes.keys() == set(range(8))
    assert outcomes[0].failure is Failure.WORKER_DIED
    assert "worker died 4 times over it" in outcomes[0].error
    assert len(tries.read_text()) == 4
    assert [outcomes[k].value for k in range(1, 8)] == list(range(1, 8))


def test_what_cannot_travel_fails_alone(two):
    def make():
        return lambda item: threading.Lock() if item == 1 else str(item)

    outcomes = list(two.stream(make, [0, 1, threading.Lock(), 3]))
    errors = {str(outcome.item): outcome.error for outcome in outcomes if outcome.error}
    assert len(outcomes) == 4
    assert "its result cannot be sent back" in errors.pop("1")
    assert "cannot be sent to a worker" in errors.popitem()[1]
    assert not errors


def test_code_that_the_hosts_do_not_have_is_reported_at_once(two):
    module = types.ModuleType("only_here")
    exec("class Worker:\n    def __call__(self, item):\n        return item\n", module.__dict__)
    sys.modules["only_here"] = module
    try:
        assert pickle.loads(pickle.dumps(module.Worker)) is module.Worker
        with pytest.raises(ClusterError, match=r"no worker can be started.*only_here.*installed"):
            list(two.stream(module.Worker, range(3)))
    finally:
        del sys.modules["only_here"]


@pytest.mark.parametrize("way", ["closed", "broken off", "items fail"])
def test_no_worker_outlives_its_stream(two, way):
    def make():
        return lambda item: os.getpid()

    def items():
        yield from range(6)
        if way == "items fail":
            raise OSError("no more items")
        yield from range(1000)

    stream = two.stream(make, items())
    pids = {next(stream).value for _ in range(4)}
    if way == "closed":
        stream.close()
    elif way == "broken off":
        with pytest.raises(KeyboardInterrupt):
            stream.throw(KeyboardInterrupt())
    else:
        with pytest.raises(OSError, match="no more items"):
            list(stream)
    assert wait_until_gone(pids) == set()


def test_a_stream_outside_its_with_statement_is_refused():
    with pytest.raises(ClusterError, match="use it inside its `with` statement"):
        next(Cluster.connect(workers=1).stream(squaring(), [1]))


def test_a_negative_number_of_workers_is_refused():
    with pytest.raises(ClusterError, match="workers must be 0 or more, got -1"):
        Cluster.connect(workers=-1)


JOINER = """
import sys
from services.cluster import Cluster, ray_cluster
from services.errors import ClusterError
ray_cluster.REACH_S = float(sys.argv[2])
try:
    with Cluster.connect(sys.argv[1]) as cluster:
        print(sorted(outcome.value for outcome in cluster.stream(lambda: abs, [-1, -2, -3])))
except ClusterError as error:
    print(error)
"""


@pytest.mark.slow
def test_a_running_cluster_can_be_joined_and_is_left_running(two, spawn):
    joiner = spawn(JOINER, ray.get_runtime_context().gcs_address, 60)
    assert joiner.communicate(timeout=120)[0] == "[1, 2, 3]\n"
    assert [outcome.value for outcome in two.stream(squaring(), [3])] == [9]


@pytest.mark.slow
def test_a_cluster_that_does_not_answer_is_an_error_in_bounded_time(spawn):
    said, _ = spawn(JOINER, "127.0.0.1:1", 2).communicate(timeout=60)
    assert "no Ray cluster can be joined at '127.0.0.1:1': no answer within 2 s; check" in said
    assert said.count("\n") == 1


def test_an_address_that_cannot_be_one_is_an_error_with_rays_reason(spawn):
    said, _ = spawn(JOINER, "ray:/nowhere", 60).communicate(timeout=90)
    assert "no Ray cluster can be joined at 'ray:/nowhere': ValueError" in said
    assert said.count("\n") == 1
