"""What a cluster tells of jobs and machines, read; logs cut into lines."""

import io
import zipfile
from datetime import UTC, datetime, timedelta

from services.cluster.jobs import Job, JobStatus, _Lines
from services.cluster.nodes import Node
from services.cluster.package import Package

TOLD = {
    "type": "SUBMISSION",
    "job_id": None,
    "submission_id": "generate-demo-1",
    "status": "STOPPED",
    "entrypoint": "lmtr generate",
    "message": "Job was intentionally stopped.",
    "start_time": 1_795_712_786_000,
    "end_time": 1_795_712_796_500,
    "metadata": {"lmtr.stage": "generate"},
    "driver_exit_code": None,
}


def test_a_job_is_read_as_ray_tells_it():
    job = Job.model_validate(TOLD)
    assert (job.id, job.status, job.ended) == ("generate-demo-1", JobStatus.STOPPED, True)
    assert job.noted("lmtr.stage") == "generate"
    assert job.noted("other") == ""
    assert job.lasted(datetime.now(UTC)) == timedelta(seconds=10.5)
    running = Job.model_validate({**TOLD, "status": "RUNNING", "end_time": 0, "metadata": None})
    assert not running.ended
    assert running.lasted(running.since + timedelta(seconds=3)) == timedelta(seconds=3)
    ahead = running.since - timedelta(seconds=3)  # the cluster's clock is ahead of ours
    assert running.lasted(ahead) == timedelta()


def test_a_node_is_read_as_ray_tells_it():
    told = {
        "node_id": "2d9a",
        "node_ip": "10.0.0.2",
        "is_head_node": True,
        "state": "DEAD",
        "state_message": "Unexpected termination: health check failed",
        "node_name": "worker-1",
        "resources_total": {"CPU": 2.0, "memory": 21e9},
        "start_time_ms": 1_000,
        "end_time_ms": 5_000,
    }
    node = Node.model_validate(told)
    assert (node.name, node.is_head, node.alive, node.resources["CPU"]) == (
        "worker-1",
        True,
        False,
        2,
    )
    assert node.since == datetime.fromtimestamp(5, UTC)


def heard(*streams):
    """Lines heard of streams that each begin with the first letter."""
    lines = []
    cut = _Lines(lines.append)
    for pieces in streams:
        cut.begin()
        for piece in pieces:
            cut.take(piece)
    cut.end()
    return lines


def test_a_log_in_pieces_is_heard_in_lines():
    assert heard(["one\ntw", "o\n", "", "three"]) == ["one", "two", "three"]


def test_a_log_that_is_heard_again_from_its_beginning_goes_on_where_it_was():
    assert heard(["one\ntw"], ["o", "ne\ntwo\nth", "ree\n"]) == ["one", "two", "three"]
    assert heard(["one\n"], ["one\n"], ["one\n", "two\n"]) == ["one", "two"]


def test_the_same_files_make_the_same_package():
    first = Package.of({"b.toml": "x = 'é'", "a.toml": ""})
    assert first == Package.of({"a.toml": "", "b.toml": "x = 'é'"})
    assert first.name != Package.of({"a.toml": ""}).name
    with zipfile.ZipFile(io.BytesIO(first.content)) as archive:
        assert archive.namelist() == ["a.toml", "b.toml"]
        assert archive.read("b.toml").decode() == "x = 'é'"
