"""What `lmtr doctor --cluster` says of a cluster, for every fault that one may tell of."""

import pytest

from pipelines.checkup.finding import Finding, Grade
from pipelines.checkup.judgement import judged
from pipelines.checkup.report import (
    ClusterReport,
    HomeReport,
    MachineReport,
    NodeReport,
    TrackerReport,
)
from pipelines.remote.versions import Versions
from services.cluster.clock import Offset
from services.machine import Room

HERE = Versions(lmtr="0.1.0", code="0.1.0+abc", ray="2.60.0", python="3.11.7", home="/data/home")
WIDE = Room(path="/tmp", free=10**11, total=10**12)
MACHINE = MachineReport(
    versions=HERE,
    processors=8.0,
    memory_free=8 * 10**9,
    shared=Room(path="/dev/shm", free=10**9, total=10**9),
    temporary=WIDE,
    cache=WIDE,
    compiler="/usr/bin/gcc",
    compiled=2,
    sees_home=True,
)
NEAR = Offset(-0.001, 0.002)
HEAD = NodeReport(
    name="head",
    address="10.0.0.1",
    is_head=True,
    store=2.5e8,
    offset=Offset(-1e-4, 1e-4),
    machine=MACHINE,
)
WORKER = HEAD.model_copy(
    update={"name": "worker", "address": "10.0.0.2", "is_head": False, "offered": 8.0}
)
HOME = HomeReport(
    place="/data/home", known=True, room=Room(path="/data/home", free=10**11, total=10**12)
)
TRACKER = TrackerReport(
    uri="http://tracking:5000", is_server=True, version="3.17.2", client="3.17.2"
)
CLUSTER = ClusterReport(versions=HERE, nodes=(HEAD, WORKER), home=HOME, tracker=TRACKER)
PROFILE = "http://127.0.0.1:5000"


def findings(cluster=CLUSTER, ours=HERE, client=NEAR, tracking=PROFILE) -> list[Finding]:
    return list(judged(cluster, ours, client, tracking))


def bad(*args, **options) -> list[Finding]:
    return [finding for finding in findings(*args, **options) if finding.grade is not Grade.GOOD]


def worker(**machine) -> ClusterReport:
    """The cluster with a worker that tells something else."""
    told = WORKER.model_copy(update={"machine": MACHINE.model_copy(update=machine)})
    return CLUSTER.model_copy(update={"nodes": (HEAD, told)})


def only(found: list[Finding], subject: str, grade: Grade, *words: str) -> Finding:
    """The one finding, which names cause and mend."""
    (finding,) = found
    assert (finding.subject, finding.grade) == (subject, grade), finding
    assert finding.mend
    for word in words:
        assert word in f"{finding.state} | {finding.mend}"
    return finding


def test_a_cluster_that_is_well_is_well_in_one_line_a_subject():
    found = findings()
    assert bad() == []
    subjects = [finding.subject for finding in found]
    assert len(set(subjects)) == len(subjects)
    nodes = [each.state for each in found if each.subject in ("nodes", "versions", "memory")]
    assert nodes == [
        "all 2 nodes: answer",
        "all 2 nodes: as on the head",
        "all 2 nodes: 8.0 GB free",
    ]


@pytest.mark.parametrize(
    ("other", "words"),
    [
        ({"lmtr": "0.2.0"}, "LMTR 0.1.0 where this client has 0.2.0"),
        ({"ray": "2.1.0"}, "Ray 2.60.0 where this client has 2.1.0"),
    ],
)
def test_other_versions_of_the_client_are_a_fault(other, words):
    found = bad(ours=HERE.model_copy(update=other))
    only(found, "versions of jobs", Grade.FAULT, words, "lmtr==0.1.0", "image")


def test_another_commit_or_python_is_a_warning_and_the_last_figure_of_python_nothing():
    found = bad(ours=HERE.model_copy(update={"code": "0.1.0+fed"}))
    only(found, "versions of jobs", Grade.WARNING, "code 0.1.0+abc where this client has 0.1.0+fed")
    found = bad(ours=HERE.model_copy(update={"python": "3.12.1"}))
    only(found, "versions of jobs", Grade.WARNING, "Python 3.11 where this client has 3.12")
    assert bad(ours=HERE.model_copy(update={"python": "3.11.2"})) == []


@pytest.mark.parametrize(
    ("other", "grade", "words"),
    [
        ({"lmtr": "0.2.0"}, Grade.FAULT, "worker 10.0.0.2: LMTR 0.2.0 where jobs have 0.1.0"),
        ({"ray": "2.1.0"}, Grade.FAULT, "worker 10.0.0.2: Ray 2.1.0 where jobs have 2.60.0"),
        ({"python": "3.11.2"}, Grade.FAULT, "Python 3.11.2 where jobs have 3.11.7"),
        ({"code": "0.1.0+fed"}, Grade.WARNING, "code 0.1.0+fed where jobs have 0.1.0+abc"),
    ],
)
def test_a_node_with_other_versions_is_named(other, grade, words):
    found = bad(worker(versions=HERE.model_copy(update=other)))
    only(found, "versions", grade, words)


@pytest.mark.parametrize(
    ("error", "words"),
    [
        ("no answer within 15 s", ("does not say what it has", "lmtr status")),
        ("ModuleNotFoundError: No module named 'pipelines'", ("has no LMTR", "image")),
    ],
)
def test_a_node_that_does_not_answer_is_named_and_asked_nothing_more(error, words):
    silent = WORKER.model_copy(update={"machine": None, "error": error, "offset": None})
    found = bad(CLUSTER.model_copy(update={"nodes": (HEAD, silent)}))
    only(found, "nodes", Grade.FAULT, "worker 10.0.0.2", *words)


def test_nodes_that_could_not_be_asked_leave_home_and_tracker():
    report = CLUSTER.model_copy(update={"nodes": (), "fault": "no Ray cluster can be joined"})
    only(bad(report), "nodes", Grade.FAULT, "no Ray cluster can be joined")
    assert "home" in [finding.subject for finding in findings(report)]


@pytest.mark.parametrize(
    ("ahead", "grade"), [(0.9, None), (1.5, Grade.WARNING), (-1.5, Grade.WARNING),
                         (29.0, Grade.WARNING), (31.0, Grade.FAULT), (-31.0, Grade.FAULT)]
)  # fmt: skip
def test_one_clock_that_is_off_is_that_nodes(ahead, grade):
    off = WORKER.model_copy(update={"offset": Offset(ahead - 1e-3, ahead + 1e-3)})
    found = bad(CLUSTER.model_copy(update={"nodes": (HEAD, off)}))
    if grade is None:
        assert found == []
    else:
        way = "ahead" if ahead > 0 else "behind"
        only(found, "clocks", grade, f"worker 10.0.0.2: {abs(ahead):.1f} s {way}", "NTP")


def test_all_clocks_off_alike_are_one_finding_and_a_slow_answer_proves_nothing():
    found = bad(client=Offset(40.0, 40.2))
    only(found, "clocks", Grade.FAULT, "all 2 nodes: 40.1 s ahead (±0.1 s)", "this client and")
    assert bad(client=Offset(-3.0, 6.0)) == []
    only(bad(client=Offset(20.0, 50.0)), "clocks", Grade.WARNING)
    only(bad(client=None), "clocks", Grade.WARNING, "does not tell its time")


@pytest.mark.parametrize(
    ("machine", "subject", "grade", "words"),
    [
        ({"memory_free": 10**8}, "memory", Grade.WARNING, ("0.1 GB free", "--num-cpus")),
        (
            {"shared": Room(path="/dev/shm", free=10**7, total=64 * 10**6)},
            "shared memory",
            Grade.WARNING,
            ("/dev/shm holds 0.06 GB", "--shm-size"),
        ),
        (
            {"temporary": Room(path="/tmp", free=5 * 10**8, total=10**9)},
            "temporary files",
            Grade.WARNING,
            ("0.5 of 1.0 GB free in /tmp", "make room"),
        ),
        (
            {"temporary": Room(path="/tmp", free=10**6, total=10**9)},
            "temporary files",
            Grade.FAULT,
            ("0.0 of 1.0 GB free in /tmp",),
        ),
        (
            {"temporary": Room(path="/tmp", error="Permission denied")},
            "temporary files",
            Grade.WARNING,
            ("/tmp: Permission denied",),
        ),
        ({"compiler": ""}, "C compiler", Grade.WARNING, ("install gcc", "four times")),
        (
            {"cache_fault": "cache /c can be written by others; forbid it with `chmod go-w /c`"},
            "compiled experts",
            Grade.WARNING,
            ("cache /c can be written by others", "chmod go-w /c"),
        ),
        (
            {"cache": Room(path="/c", free=10**8, total=10**9)},
            "compiled experts",
            Grade.WARNING,
            ("free in /c",),
        ),
        (
            {"unset": ("RAY_health_check_period_ms",)},
            "RAY_… variables",
            Grade.WARNING,
            ("RAY_health_check_period_ms", "docs/clusters-existing.md"),
        ),
        (
            {"versions": HERE.model_copy(update={"home": "/other"})},
            "LMTR_HOME",
            Grade.WARNING,
            ("/other where the head has /data/home",),
        ),
        ({"processors": 2.0}, "processors", Grade.WARNING, ("offers 8", "has 2", "--num-cpus=2")),
    ],
)
def test_what_a_node_lacks_is_told_of_that_node(machine, subject, grade, words):
    only(bad(worker(**machine)), subject, grade, "worker 10.0.0.2: ", *words)


def test_a_head_that_solves_nothing_needs_no_compiler():
    head = HEAD.model_copy(update={"machine": MACHINE.model_copy(update={"compiler": ""})})
    assert bad(CLUSTER.model_copy(update={"nodes": (head, WORKER)})) == []


def test_a_worker_need_not_see_the_home():
    found = findings(worker(sees_home=False))
    assert any("does not see the head's home" in finding.state for finding in found)
    assert bad(worker(sees_home=False)) == []


def test_the_same_fault_of_many_nodes_is_one_line():
    lacking = MACHINE.model_copy(update={"compiler": ""})
    many = tuple(
        WORKER.model_copy(update={"name": f"w{n}", "machine": lacking if n else MACHINE})
        for n in range(6)
    )
    found = bad(CLUSTER.model_copy(update={"nodes": (HEAD, *many)}))
    only(found, "C compiler", Grade.WARNING, "5 of 6 nodes (w1 10.0.0.2, w2 10.0.0.2, w3")


def test_a_cluster_without_processors_is_a_fault():
    found = bad(CLUSTER.model_copy(update={"nodes": (HEAD,)}))
    only(found, "processors", Grade.FAULT, "no node offers any", "ray start")


@pytest.mark.parametrize(
    ("home", "subject", "grade", "words"),
    [
        (HomeReport(), "home", Grade.FAULT, ("none is named", "--home")),
        (
            HomeReport(place="/data/home", fault="home /data/home is a file; choose another"),
            "home",
            Grade.FAULT,
            ("home /data/home is a file", "choose another"),
        ),
        (
            HomeReport(place="s3://b/p", remote=True, known=True, seconds=0.9),
            "object store",
            Grade.WARNING,
            ("900 ms", "nearer"),
        ),
        (
            HOME.model_copy(update={"room": Room(path="/data", free=2 * 10**9, total=10**10)}),
            "room for the home",
            Grade.WARNING,
            ("2.0 of 10.0 GB free in /data", "make room"),
        ),
        (
            HOME.model_copy(update={"room": Room(path="/data", free=10**7, total=10**10)}),
            "room for the home",
            Grade.FAULT,
            ("make room",),
        ),
    ],
)
def test_a_home_that_jobs_cannot_use_well(home, subject, grade, words):
    only(bad(CLUSTER.model_copy(update={"home": home})), subject, grade, *words)


@pytest.mark.parametrize(
    ("tracker", "tracking", "grade", "words"),
    [
        ({"fault": "MLflow at x: refused; check it"}, PROFILE, Grade.FAULT, ("check it",)),
        ({"version": "2.0.0"}, PROFILE, Grade.WARNING, ("MLflow 2.0.0 where jobs have 3.17.2",)),
        ({"is_server": False, "uri": ""}, PROFILE, Grade.WARNING, ("LMTR_TRACKING", PROFILE)),
        ({"is_server": False, "uri": ""}, None, None, ()),
    ],
)
def test_a_tracker_that_runs_do_not_reach(tracker, tracking, grade, words):
    report = CLUSTER.model_copy(update={"tracker": TRACKER.model_copy(update=tracker)})
    found = bad(report, tracking=tracking)
    if grade is None:
        assert found == []
    else:
        only(found, "MLflow from the head", grade, *words)


def test_what_another_version_tells_beside_or_not_is_no_fault():
    told = CLUSTER.model_dump(mode="json")
    told["of_later_versions"] = 1
    del told["nodes"][1]["machine"]["shared"]
    del told["nodes"][1]["machine"]["memory_free"]
    assert bad(ClusterReport.model_validate(told)) == []
