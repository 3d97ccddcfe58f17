"""Whether the cluster has the programs that we have: asked before anything is submitted to it."""

import os
import platform
import time
import uuid
from importlib import metadata

from pydantic import BaseModel, ConfigDict, ValidationError

from lmtr import __version__
from pipelines.provenance import code_version
from pipelines.remote.target import Target
from services.cluster.jobs import Job, JobStatus
from services.errors import ClusterError

PURPOSE = "lmtr.purpose"
ASKING = "versions"

FRESH_S = 900.0
"""An answer that suits us holds for so long; a head that is started anew has forgotten it."""

PATIENCE_S = 60.0

ASK = "lmtr versions"
"""What the job that is asked runs."""


class Versions(BaseModel):
    """What decides whether a client and a cluster understand each other.

    Attributes:
        lmtr: Version of LMTR, which is part of a data set's identity.
        code: The same with the commit, where that can be told.
        ray: Version of Ray.
        python: Version of Python.
        home: ``LMTR_HOME``; empty if it is not set.
    """

    model_config = ConfigDict(frozen=True, extra="ignore")

    lmtr: str
    code: str
    ray: str
    python: str
    home: str = ""

    @classmethod
    def here(cls) -> "Versions":
        """Those of this process."""
        return cls(
            lmtr=__version__,
            code=code_version(),
            ray=metadata.version("ray"),
            python=platform.python_version(),
            home=os.environ.get("LMTR_HOME", ""),
        )


def cluster_versions(target: Target, *, anew: bool = False) -> Versions:
    """Those of a cluster, which a small job on its head tells; an answer of late is taken again.

    Args:
        target: The cluster.
        anew: Take no earlier answer: nobody is refused for what may have been mended since.

    Raises:
        ClusterError: The cluster does not answer, or has no LMTR that can tell.
    """
    known = [job for job in target.jobs.list() if job.noted(PURPOSE) == ASKING and _fresh(job)]
    job = known[-1] if known and not anew else _ask(target)
    log = target.jobs.log(job.id or "")
    for line in reversed(log.splitlines()):
        try:
            return Versions.model_validate_json(line)
        except ValidationError:
            continue
    reason = "`lmtr` is not on the PATH of its head" if "not found" in log else "an older LMTR"
    raise ClusterError(
        f"cluster {target.url}: it does not tell its version of LMTR ({reason}); run it from the "
        f"image of LMTR {__version__}, or install that on all of its machines"
    )


def require_same(ours: Versions, theirs: Versions, url: str) -> None:
    """Refuse a cluster with other versions of LMTR or Ray.

    A job is a command and a file of text, so Python need not be the same on both sides.

    Raises:
        ClusterError: They differ; says which and what to do.
    """
    differing = differences(ours, theirs)
    if differing:
        raise ClusterError(
            f"cluster {url}: it has {', '.join(differing)}; run the cluster from this version's "
            f"image, or install here what it has (lmtr=={theirs.lmtr}, ray=={theirs.ray}), or "
            "submit all the same with --any-version"
        )


def differences(ours: Versions, theirs: Versions) -> list[str]:
    """What keeps a client and a cluster from understanding each other, in words."""
    return _compared(("LMTR", ours.lmtr, theirs.lmtr), ("Ray", ours.ray, theirs.ray))


def remarks(ours: Versions, theirs: Versions) -> list[str]:
    """What differs between a client and a cluster and hinders neither, in words."""
    pythons = (_minor(ours.python), _minor(theirs.python))
    return _compared(("code", ours.code, theirs.code), ("Python", *pythons))


def _compared(*pairs: tuple[str, str, str]) -> list[str]:
    return [
        f"{name} {there} where this client has {here}"
        for name, here, there in pairs
        if here != there
    ]


def say_versions() -> str:
    """What the job that is asked prints."""
    return Versions.here().model_dump_json()


def _minor(version: str) -> str:
    return ".".join(version.split(".")[:2])


def _fresh(job: Job) -> bool:
    return job.status is JobStatus.SUCCEEDED and time.time() - (job.start_time or 0) / 1e3 < FRESH_S


def _ask(target: Target) -> Job:
    job_id = f"versions-{time.strftime('%Y%m%d-%H%M%S')}-{uuid.uuid4().hex[:6]}"
    target.jobs.submit(job_id, ASK, {PURPOSE: ASKING})
    job = target.jobs.await_end(job_id, PATIENCE_S)
    if not job.ended:
        raise ClusterError(
            f"cluster {target.url}: it does not begin a job within {PATIENCE_S:.0f} s (its status "
            f"is {job.status.lower()}); look at `{target.command('status')}` and the head's log"
        )
    return job
