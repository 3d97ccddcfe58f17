"""Faults that befall a cluster of containers under work: what comes of it is whole each time."""

import time

import pytest

from tests.docker.conftest import MODELS, ROLLOUTS, SOLUTIONS, UNDER_WAY, command
from tests.docker.patience import await_true
from tests.docker.recorded_runs import metrics, params, tags

pytestmark = [pytest.mark.slow, pytest.mark.cluster]

OUTAGE_S = 60.0
IMPATIENT = "env MLFLOW_HTTP_REQUEST_MAX_RETRIES=3"
"""Less patience with a tracker that fails than the minutes which are usual."""


def test_a_worker_killed_in_the_middle(containers, reference, faults):
    home = "/data/killed"
    job = under_generation(containers, home)
    worker = containers.names("worker")[-1]
    containers.docker("kill", worker)
    began = time.monotonic()
    await_true(lambda: containers.alive() == 2, "two nodes")
    missed = time.monotonic() - began
    containers.await_commits(home, containers.commits(home) + 1, job)
    moved = time.monotonic() - began
    seen = finished(containers, job)
    lost, doubled = compared(containers.rows(home), reference)
    faults.add("worker killed", f"{seen}; missed after {missed:.0f} s", moved, lost, doubled)
    containers.docker("start", worker)
    containers.await_healthy()
    assert (lost, doubled) == (0, 0)
    assert recorded(containers, home) == ["FINISHED"]
    assert moved < 45.0


def test_a_worker_off_the_network_for_a_minute(containers, reference, faults):
    home = "/data/cut"
    job = under_generation(containers, home)
    worker = containers.names("worker")[-1]
    containers.docker("network", "disconnect", containers.network, worker)
    began = time.monotonic()
    try:
        await_true(lambda: containers.alive() == 2, "two nodes")
        missed = time.monotonic() - began
        time.sleep(max(0.0, began + OUTAGE_S - time.monotonic()))
    finally:
        containers.docker("network", "connect", containers.network, worker)
    seen = finished(containers, job)
    lost, doubled = compared(containers.rows(home), reference)
    back = containers.await_healthy()
    words = f"{seen}; missed after {missed:.0f} s, back {back:.0f} s after the network"
    faults.add("worker off the network, 60 s", words, missed, lost, doubled)
    assert (lost, doubled) == (0, 0)
    assert recorded(containers, home) == ["FINISHED"]
    assert missed < 45.0


def test_the_head_killed_and_the_job_submitted_again(containers, reference, faults):
    home = "/data/beheaded"
    under_generation(containers, home)
    containers.crash(containers.names("head")[0])
    kept = len(containers.rows(home)) if containers.alive() else UNDER_WAY
    recovered = containers.await_healthy()
    assert SOLUTIONS > len(containers.rows(home)) >= kept >= UNDER_WAY
    assert recorded(containers, home) == ["RUNNING"]
    seen = finished(containers, containers.submit(command("generate", home)))
    lost, doubled = compared(containers.rows(home), reference)
    faults.add("head killed", f"job gone; submitted again: {seen}", recovered, lost, doubled)
    assert (lost, doubled) == (0, 0)
    assert recorded(containers, home) == ["KILLED", "FINISHED"]


def test_the_head_told_to_end(containers, reference, faults):
    home = "/data/ended"
    under_generation(containers, home)
    head = containers.names("head")[0]
    began = time.monotonic()
    containers.docker("stop", "--time", "120", head)
    took = time.monotonic() - began
    assert "drain-jobs: 1 jobs stopped, 0 still run" in containers.logs(head)
    containers.docker("start", head)
    containers.await_healthy()
    kept = len(containers.rows(home))
    assert recorded(containers, home) == ["KILLED"]
    seen = finished(containers, containers.submit(command("generate", home)))
    lost, doubled = compared(containers.rows(home), reference)
    word = f"{kept} of {SOLUTIONS} kept; submitted again: {seen}"
    faults.add("head told to end (SIGTERM)", word, took, lost, doubled)
    assert UNDER_WAY < kept < SOLUTIONS
    assert (lost, doubled) == (0, 0)
    assert recorded(containers, home) == ["KILLED", "FINISHED"]


@pytest.fixture(scope="module")
def segments(containers, reference):
    """The reference with what a training needs."""
    home = "/data/reference"
    assert finished(containers, containers.submit(command("segment", home))) == "SUCCEEDED"
    return home


def test_the_database_away_for_a_minute_in_a_training(containers, segments, faults):
    job = under_training(containers, 1)
    database = containers.names("database")[0]
    containers.docker("stop", database)
    time.sleep(OUTAGE_S)
    containers.docker("start", database)
    began = time.monotonic()
    seen = finished(containers, job)
    note_whole(containers, 1, faults, "PostgreSQL stopped, 60 s", seen, began)


def test_the_tracking_server_restarted_in_a_training(containers, segments, faults):
    job = under_training(containers, 2)
    began = time.monotonic()
    containers.docker("restart", containers.names("tracking")[0])
    seen = finished(containers, job)
    note_whole(containers, 2, faults, "MLflow restarted", seen, began)


def test_no_room_for_artifacts_in_a_training(containers, segments, faults):
    make_room = containers.fill_artifacts()
    try:
        job = containers.finish(containers.submit(f"{IMPATIENT} {training(3)}"))
    finally:
        make_room()
    said = containers.log(job.id)
    assert job.status == "FAILED", said
    assert "Traceback" not in said
    word = next(line for line in reversed(said.splitlines()) if line.startswith("lmtr: "))
    assert "tracking" in word
    began = time.monotonic()
    again = finished(containers, containers.submit(training(3)))
    seen = f"{word}; with room, submitted again: {again}"
    note_whole(containers, 3, faults, "no room for artifacts", seen, began)


def test_an_evaluation_loses_a_worker(containers, segments, faults):
    assert finished(containers, containers.submit(training(4))) == "SUCCEEDED"
    job = containers.submit(evaluation(4))
    containers.await_work(job)
    worker = containers.names("worker")[-1]
    began = time.monotonic()
    containers.crash(worker)
    seen = finished(containers, job)
    containers.await_healthy()
    taken = containers.query(
        segments,
        'SELECT evaluation_id, count(*) AS rows, count(DISTINCT "index") AS courses FROM rollouts '
        "JOIN evaluations USING (evaluation_id) WHERE training_seed = 4 GROUP BY ALL",
    )
    lost = sum(ROLLOUTS - each["courses"] for each in taken)
    doubled = sum(each["rows"] - each["courses"] for each in taken)
    word = "worker crashed in an evaluation"
    faults.add(word, seen, time.monotonic() - began, lost, doubled)
    assert taken
    assert (lost, doubled) == (0, 0)


def training(seed):
    """A training that takes some twenty seconds, whose models no other test has."""
    options = ("--set", f"training.seeds=[{seed}]", "--set", "training.optimizer.epochs=200")
    return command("train", "/data/reference", *options)


def evaluation(seed):
    """The evaluation of those models."""
    options = ("--set", f"training.seeds=[{seed}]", "--set", "training.optimizer.epochs=200")
    return command("evaluate", "/data/reference", *options)


def under_generation(containers, home):
    """A generation that has made something, and has more to make."""
    job = containers.submit(command("generate", home))
    containers.await_commits(home, UNDER_WAY, job)
    return job


def under_training(containers, seed):
    """A training that has begun."""
    job = containers.submit(training(seed))
    containers.await_work(job)
    return job


def finished(containers, job_id):
    """How a job ended; a failed one says why."""
    job = containers.finish(job_id)
    if job.status == "SUCCEEDED":
        return job.status
    return f"{job.status}: {containers.log(job_id)[-1500:]}"


def compared(rows, reference):
    """How many rows were lost, or are others, and how many are there twice."""
    return len(set(reference) - set(rows)), len(rows) - len({index for index, _ in rows})


def recorded(containers, home):
    """How MLflow says that the generations of a home ended, the oldest first."""
    runs = [run["info"] for run in containers.runs("generation") if tags(run).get("home") == home]
    return [run["status"] for run in sorted(runs, key=lambda run: run["start_time"])]


def note_whole(containers, seed, faults, fault, seen, began):
    """All models are there once; MLflow has one finished run of each, with metrics and files."""
    took = time.monotonic() - began
    assert seen.endswith("SUCCEEDED"), seen
    containers.await_healthy()
    runs = [run for run in containers.runs("training") if params(run).get("seed") == str(seed)]
    names = [run["info"]["run_name"] for run in runs]
    missing = len(MODELS - {name.split(" seed")[0] for name in names})
    doubled = len(names) - len(set(names))
    faults.add(fault, seen, took, missing, doubled)
    assert (missing, doubled) == (0, 0), names
    for run in runs:
        assert run["info"]["status"] == "FINISHED"
        assert set(metrics(run)) >= {"best.loss", "train.loss"}
        assert containers.files(run["info"]["run_id"]), "no files"
