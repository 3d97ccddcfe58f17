"""What is to be said of a cluster, from what was told and from nothing else."""

from collections.abc import Iterator

from pipelines.checkup.finding import Finding
from pipelines.checkup.nodes import GB, judged_nodes, room_fault
from pipelines.checkup.report import ClusterReport, HomeReport, TrackerReport
from pipelines.remote.versions import Versions, differences, remarks
from services.cluster.clock import Offset

LOW_HOME = 5e9
"""A data set with its models and reports fits into less; a study may not."""

SLOW_STORE_S = 0.3


def judged(
    report: ClusterReport, ours: Versions, client: Offset | None, tracking: str | None
) -> Iterator[Finding]:
    """All findings.

    Args:
        report: What the cluster told.
        ours: Versions of this client.
        client: How far the head's clock is ahead of this client's; None if unknown.
        tracking: The MLflow server of the client's profile; None if it names none.
    """
    yield from _versions(ours, report.versions)
    if report.fault:
        yield Finding("nodes", report.fault, "look at the log of the head's Ray", fatal=True)
    else:
        yield from judged_nodes(report.nodes, report.versions, client)
    yield from _home(report.home)
    yield from _tracker(report.tracker, tracking)


def _versions(ours: Versions, theirs: Versions) -> Iterator[Finding]:
    differing = differences(ours, theirs)
    if differing:
        yield Finding(
            "versions of jobs",
            ", ".join(differing),
            f"run the cluster from this version's image, or install here lmtr=={theirs.lmtr}, "
            f"ray=={theirs.ray}",
            fatal=True,
        )
    elif remarked := remarks(ours, theirs):
        yield Finding(
            "versions of jobs",
            ", ".join(remarked),
            "jobs need no more than this; update whichever is older, if the difference matters",
        )
    else:
        yield Finding(
            "versions of jobs",
            f"LMTR {theirs.code}, Ray {theirs.ray}, Python {theirs.python}, as here",
        )


def _home(home: HomeReport) -> Iterator[Finding]:
    if not home.place:
        yield Finding(
            "home",
            "none is named, and the cluster's machines have no LMTR_HOME",
            "give --home as they see it, or `home` in the profile",
            fatal=True,
        )
        return
    if home.fault:
        cause, _, mend = home.fault.partition("; ")
        yield Finding("home", cause, mend or "mend this first", fatal=True)
        return
    yield Finding("home", home.place + ("" if home.known else ": the first job makes it"))
    yield Finding("conditional writes", "honoured: no commit overwrites another")
    if home.seconds is not None:
        slow = home.seconds > SLOW_STORE_S
        yield Finding(
            "object store",
            f"answers the head in {home.seconds * 1e3:.0f} ms",
            "use a store that is nearer: a commit takes several requests" if slow else "",
        )
    if home.room is not None:
        fault = room_fault(home.room, LOW_HOME)
        state, mend, fatal = fault or (f"{home.room.free / GB:.0f} GB free", "", False)
        yield Finding("room for the home", state, mend, fatal)


def _tracker(tracker: TrackerReport, tracking: str | None) -> Iterator[Finding]:
    subject = "MLflow from the head"
    if tracker.fault:
        cause, _, mend = tracker.fault.partition("; ")
        yield Finding(subject, cause, mend or "mend this first", fatal=True)
    elif not tracker.is_server:
        state = f"none: runs are kept in {tracker.uri or 'a database in the home'}"
        mend = f"set LMTR_TRACKING on every node, or no run reaches {tracking}"
        yield Finding(subject, state, mend if tracking else "")
    elif tracker.version != tracker.client:
        yield Finding(
            subject,
            f"{tracker.uri} has MLflow {tracker.version} where jobs have {tracker.client}",
            "install one version: a server and clients of others may not understand each other",
        )
    else:
        yield Finding(subject, f"{tracker.uri} answers, MLflow {tracker.version}")
