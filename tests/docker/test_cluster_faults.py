"""Faults that befall a cluster of containers under work: what comes of it is whole each time."""

import time

import pytest

from tests.docker.conftest import SOLUTIONS, command
from tests.docker.containers import await_true

pytestmark = pytest.mark.slow

OUTAGE_S = 60.0
UNDER_WAY = SOLUTIONS // 8


def test_a_worker_killed_in_the_middle(containers, reference, faults):
    home = "/data/killed"
    job = containers.submit(command("generate", home))
    containers.await_rows(home, UNDER_WAY, job)
    worker = containers.names("worker")[-1]
    containers.docker("kill", worker)
    began = time.monotonic()
    await_true(lambda: containers.alive() == 2, "two nodes")
    missed = time.monotonic() - began
    before = len(containers.rows(home))
    containers.await_rows(home, min(before + 8, SOLUTIONS), job)
    seen = finished(containers, job)
    lost, doubled = compared(containers.rows(home), reference)
    faults.add("worker killed", f"{seen}; missed after {missed:.0f} s", missed, lost, doubled)
    containers.docker("start", worker)
    containers.await_healthy()
    assert (lost, doubled) == (0, 0)
    assert missed < 45.0


def test_a_worker_off_the_network_for_a_minute(containers, reference, faults):
    home = "/data/cut"
    job = containers.submit(command("generate", home))
    containers.await_rows(home, UNDER_WAY, job)
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
    assert missed < 45.0


def test_the_head_killed_and_the_job_submitted_again(containers, reference, faults):
    home = "/data/beheaded"
    job = containers.submit(command("generate", home))
    containers.await_rows(home, UNDER_WAY, job)
    containers.crash(containers.names("head")[0])
    kept = len(containers.rows(home)) if containers.alive() else UNDER_WAY
    recovered = containers.await_healthy()
    assert len(containers.rows(home)) >= kept >= UNDER_WAY
    seen = finished(containers, containers.submit(command("generate", home)))
    lost, doubled = compared(containers.rows(home), reference)
    faults.add("head killed", f"job gone; submitted again: {seen}", recovered, lost, doubled)
    assert (lost, doubled) == (0, 0)


@pytest.fixture
def segments(containers, reference):
    """A home of a test's own that has what a training needs."""
    home = f"/data/training-{time.monotonic_ns()}"
    containers.inside("head", "cp", "-r", "/data/reference", home)
    assert finished(containers, containers.submit(command("segment", home))) == "SUCCEEDED"
    return home


def test_the_database_away_for_a_minute_in_a_training(containers, segments, faults):
    job = under_training(containers, segments)
    database = containers.names("database")[0]
    containers.docker("stop", database)
    time.sleep(OUTAGE_S)
    containers.docker("start", database)
    recovered = containers.await_healthy()
    seen = finished(containers, job)
    require_whole(containers, segments)
    faults.add("PostgreSQL stopped, 60 s", seen, recovered, 0, 0)


def test_the_tracking_server_restarted_in_a_training(containers, segments, faults):
    job = under_training(containers, segments)
    containers.docker("restart", containers.names("tracking")[0])
    recovered = containers.await_healthy()
    seen = finished(containers, job)
    require_whole(containers, segments)
    faults.add("MLflow restarted", seen, recovered, 0, 0)


def test_no_room_for_artifacts_in_a_training(containers, segments, faults):
    make_room = containers.fill_artifacts()
    try:
        job = containers.finish(containers.submit(command("train", segments)))
        said = containers.log(job.id)
    finally:
        make_room()
    began = time.monotonic()
    assert finished(containers, containers.submit(command("train", segments))) == "SUCCEEDED"
    require_whole(containers, segments)
    word = next(line for line in reversed(said.splitlines()) if line.startswith("lmtr: "))
    faults.add("no room for artifacts", word, time.monotonic() - began, 0, 0)
    assert job.status == "FAILED", said
    assert "tracking" in word
    assert "Traceback" not in said


def under_training(containers, home):
    """A training that has begun."""
    job = containers.submit(command("train", home))
    await_true(lambda: "Training" in containers.log(job), "training")
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


def require_whole(containers, home):
    """Both models are there, and MLflow has a finished run with metrics and files of each."""
    told = containers.inside("head", "lmtr", "--home", home, "lake", "check")
    assert "ok" in told or "whole" in told, told
    mine = [run for run in containers.runs("training") if home in str(run)]
    assert mine, "no runs"
    assert {run["info"]["status"] for run in mine} == {"FINISHED"}
