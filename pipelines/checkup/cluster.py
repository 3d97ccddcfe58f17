"""``lmtr doctor --cluster``: the checks in their order, each only where the one before it leads."""

import shlex
import time
import uuid
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

from pydantic import ValidationError

from lmtr import __version__
from pipelines.checkup.entrance import examined_entrance, examined_tracking
from pipelines.checkup.finding import Finding, healthy, show
from pipelines.checkup.judgement import judged
from pipelines.checkup.report import ClusterReport
from pipelines.progress import say
from pipelines.remote.target import Target
from pipelines.remote.versions import PURPOSE, Versions
from services.cluster.clock import Offset
from services.errors import ClusterError, ServiceError

ASKING = "doctor"

EXAMINE = ("lmtr", "examine")
"""What the job runs."""

PATIENCE_S = 60.0
"""How long it may take (s); each of its parts gives up earlier."""


def examine(find: Callable[[], Target], *, form_json: bool = False) -> bool:
    """Print the findings for a cluster; returns whether nothing fatal was found.

    Args:
        find: Tells which cluster.
        form_json: Print them as JSON, for programs.
    """
    try:
        target = find()
    except ServiceError as error:
        show(f"LMTR {__version__}: cluster", [Finding.of("profile", error)], form_json=form_json)
        return False
    findings = list(_findings(target))
    show(f"LMTR {__version__}: cluster {target.url}", findings, form_json=form_json)
    return healthy(findings)


def _findings(target: Target) -> Iterator[Finding]:
    with ThreadPoolExecutor(1) as pool:
        tracking = target.tracking and pool.submit(examined_tracking, target.tracking)
        entrance = list(examined_entrance(target))
        yield from entrance
        if healthy(entrance):
            yield from _inside(target)
        if tracking:
            yield tracking.result()


def _inside(target: Target) -> Iterator[Finding]:
    say(f"asking the nodes of {target.url}, which takes some seconds")
    try:
        report, offset = asked_cluster(target)
    except ServiceError as error:
        yield Finding.of("a job's answer", error)
        return
    yield from judged(report, Versions.here(), offset, target.tracking)


def asked_cluster(target: Target) -> tuple[ClusterReport, Offset | None]:
    """What a small job on the head tells, and how far its clock is ahead of ours.

    Raises:
        ClusterError: The cluster does not answer, or its LMTR cannot tell.
    """
    job_id = f"doctor-{time.strftime('%Y%m%d-%H%M%S')}-{uuid.uuid4().hex[:6]}"
    sent = time.time()
    target.jobs.submit(job_id, _entrypoint(target), {PURPOSE: ASKING})
    heard = time.time()
    job = target.jobs.await_end(job_id, PATIENCE_S)
    # The head noted the time between our request and its answer.
    offset = None if job.since is None else Offset.told(sent, job.since.timestamp(), heard)
    log = target.jobs.log(job_id)
    for line in reversed(log.splitlines()):
        try:
            return ClusterReport.model_validate_json(line), offset
        except ValidationError:
            continue
    if not job.ended:
        target.jobs.stop(job_id)
        raise ClusterError(
            f"it does not end a job within {PATIENCE_S:.0f} s (its status is "
            f"{job.status.lower()}); look at `{target.command('status')}`, "
            f"`{target.command('logs', job_id)}` and the head's log"
        )
    raise ClusterError(_no_report(log, target.command("logs", job_id)))


def _entrypoint(target: Target) -> str:
    program, command = EXAMINE
    before = [] if target.home is None else ["--home", target.home]
    return shlex.join([program, *before, command])


def _no_report(log: str, look: str) -> str:
    """Why a job that has ended told nothing, and the mend."""
    image = f"run it from the image of LMTR {__version__}, or install that on all of its machines"
    if "not found" in log:
        return f"`lmtr` is not on the PATH of the head; {image}"
    if "No such command" in log:
        return f"the head has an older LMTR, which does not know `lmtr examine`; {image}"
    said = [line for line in log.splitlines() if line.strip()]
    return f"it tells nothing ({said[-1][:200] if said else 'no word'}); look at `{look}`"
