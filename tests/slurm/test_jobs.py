"""Jobs of a real SLURM, three nodes on this machine: done, and stopped before they were done."""

import os
import shutil
import stat
import sys
import tempfile
import time
from pathlib import Path

import psutil
import pytest

from benchmarks.processes import left_over
from tests.faults.driver import CONFIGURATION, committed, finish, require_equal, rows
from tests.slurm.daemons import Slurm

pytestmark = [pytest.mark.slow, pytest.mark.cluster]

SCRIPT = Path(__file__).parents[2] / "clusters" / "slurm" / "lmtr.sbatch"

COUNT = 200
"""Solutions of a data set: enough for a job to be stopped while it makes them."""

PATIENCE_S = 300.0

ENDING_S = 20.0

SOLVER = "ray::BatchSeat"


@pytest.fixture(scope="module")
def share(tmp_path_factory):
    """The disk that all nodes see."""
    folder = tmp_path_factory.mktemp("share")
    (folder / "walks.toml").write_text(CONFIGURATION)
    return folder


@pytest.fixture(scope="module")
def slurm(share):
    if obstacle := Slurm.obstacle():
        pytest.skip(obstacle)
    with Slurm(share, nodes=3, cpus=2) as three:
        yield three


@pytest.fixture(scope="module")
def variables(share):
    """What the submitting user's shell has; each host's folders lie apart, to see what is left."""
    # Ray's sockets lie in here, and the path of a socket may have 107 characters at most.
    local = Path(tempfile.mkdtemp(prefix="lmtrs-", dir="/tmp"))
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    yield {"PATH": path, "LMTR_CACHE": str(share / "cache"), "LMTR_LOCAL": str(local)}
    shutil.rmtree(local)


@pytest.fixture(scope="module")
def reference(share, variables):
    """The data set as it is made without a cluster."""
    home = share / "reference"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LMTR_CACHE", variables["LMTR_CACHE"])
        finish(home, share / "walks.toml", "--solutions", COUNT)
    return rows(home)


@pytest.fixture
def submit(slurm, variables):
    """Submit a job that generates; returns its number."""

    def of(home, *options, nodes=3):
        asked = (f"--nodes={nodes}", "--cpus-per-task=1", "--time=20")
        words = ("--home", home, "generate", "-c", "walks.toml", "--solutions", COUNT, *options)
        return slurm.submit(*asked, SCRIPT, *words, environment=variables)

    return of


def test_jobs_that_share_nodes_make_their_data_sets_and_leave_nothing(
    slurm, submit, share, variables, reference
):
    job = submit(share / "home")
    beside = submit(share / "beside", "--seed", 12, "--solutions", 8, nodes=1)
    await_solvers(slurm, job)
    nodes = share / f"lmtr-{job}.nodes"
    assert stat.S_IMODE((nodes / "token").stat().st_mode) == 0o600
    assert stat.S_IMODE(nodes.stat().st_mode) == 0o700
    token = (nodes / "token").read_text()
    assert len(token) == 64
    shown = [line_of(process) for process in psutil.process_iter()]
    logs = [place.read_text(errors="replace") for place in nodes.glob("*.log")]
    assert len(logs) == 3
    for number in (job, beside):
        assert ended(slurm, number)["JobState"] == "COMPLETED", log(share, number)
    assert not any(token in each for each in (*shown, *logs, log(share, job)))
    require_equal(rows(share / "home"), reference)
    assert rows(share / "beside").num_rows == 8
    assert f"{len(slurm.names)} of {len(slurm.names)} hosts" in log(share, job)
    require_nothing_left(slurm, share, variables)


def test_a_job_whose_time_is_up_queues_again_until_its_data_set_is_complete(
    slurm, submit, share, variables, reference
):
    home = share / "stopped"
    job = submit(home)
    await_rows(home, COUNT // 8)
    # What SLURM does itself two minutes before the time is up.
    slurm.run("scancel", "--batch", "--signal=USR1", job)
    slurm.await_state(job, "PENDING", patience_s=PATIENCE_S)
    assert COUNT // 8 <= committed(home) < COUNT
    require_nothing_left(slurm, share, variables)
    told = ended(slurm, job)
    assert (told["JobState"], told["Restarts"]) == ("COMPLETED", "1"), log(share, job)
    require_equal(rows(home), reference)
    require_nothing_left(slurm, share, variables)


def test_a_job_that_fails_ends_with_the_status_of_lmtr_and_keeps_its_logs(
    slurm, submit, share, variables
):
    job = submit(share / "none", "--set", "dataset.no_such=1", nodes=1)
    told = ended(slurm, job)
    assert (told["JobState"], told["ExitCode"]) == ("FAILED", "2:0")
    assert "no_such" in log(share, job)
    kept = [place.name for place in (share / f"lmtr-{job}.nodes").iterdir()]
    assert kept == ["head.log"]
    require_nothing_left(slurm, share, variables)


def test_a_host_that_fails_costs_no_row(slurm, submit, share, reference):
    home = share / "failed"
    job = submit(home)
    await_solvers(slurm, job)
    await_rows(home, COUNT // 8)
    slurm.power_off(slurm.names[-1])  # for all tests: this is the last one
    told = ended(slurm, job)
    assert (told["JobState"], told["Restarts"]) == ("COMPLETED", "0"), log(share, job)
    require_equal(rows(home), reference)


def await_rows(home, count):
    until = time.monotonic() + PATIENCE_S
    while (there := committed(home)) < count:
        assert time.monotonic() < until, f"{there} rows and not {count}"
        time.sleep(0.2)


def await_solvers(slurm, job):
    """Return when every node solves for this job."""
    until = time.monotonic() + PATIENCE_S
    while True:
        there = slurm.members(f"SLURM_JOB_ID={job}")
        solvers = {process.pid for process in there if line_of(process).startswith(SOLVER)}
        at = [slurm.members(f"SLURMD_NODENAME={name}") for name in slurm.names]
        if all(any(process.pid in solvers for process in each) for each in at):
            return
        assert time.monotonic() < until, f"solvers: {solvers}"
        time.sleep(0.2)


def ended(slurm, job):
    return slurm.await_state(job, "COMPLETED", "FAILED", "TIMEOUT", patience_s=PATIENCE_S)


def require_nothing_left(slurm, share, variables):
    """No process of a job, no folder on a host, and no token."""
    left = left_over(slurm.members("SLURM_JOB_NAME=lmtr"), ENDING_S)
    assert left == []
    assert list(Path(variables["LMTR_LOCAL"]).iterdir()) == []
    assert list(share.glob("*.nodes/token")) == []


def log(share, job):
    return (share / f"lmtr-{job}.log").read_text(errors="replace")


def line_of(process):
    """The command line of a process; empty once it has ended."""
    try:
        return " ".join(process.cmdline())
    except psutil.Error:
        return ""
