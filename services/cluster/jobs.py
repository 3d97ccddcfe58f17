"""Jobs of a Ray cluster: sent to it, listed, followed and stopped from outside."""

import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from typing import Any
from urllib.parse import quote

from pydantic import BaseModel, ConfigDict, Field

from services.cluster.head import Answer, Head
from services.cluster.package import Package
from services.errors import ClusterError, ClusterLostError, JobExistsError, UnknownJobError

RECONNECT_S = 30.0
"""So long a head that falls silent while a log is followed may take to come back."""

AGAIN_S = 1.0
"""Time between two tries or looks."""

STOP_WAIT_S = 90
"""So long a job that is stopped may take to finish what is under way; then Ray kills it."""

STOP_WAIT_VARIABLE = "RAY_JOB_STOP_WAIT_TIME_S"
"""Ray's own name for it, read where the job runs; three seconds without it."""


class JobStatus(StrEnum):
    """How far a job is, in Ray's words."""

    PENDING = "PENDING"
    RUNNING = "RUNNING"
    STOPPED = "STOPPED"
    SUCCEEDED = "SUCCEEDED"
    FAILED = "FAILED"


class Job(BaseModel):
    """A job as the cluster tells of it.

    Attributes:
        id: Its id; of a driver that nobody submitted, none.
        status: How far it is.
        entrypoint: Its command.
        message: Ray's words on the status.
        metadata: What was noted on it when it was submitted.
        start_time: When it was submitted (ms since 1970).
        end_time: When it ended (ms since 1970); none while it has not.
        exit_code: Of its command, unless it was stopped.
    """

    model_config = ConfigDict(frozen=True, extra="ignore")

    id: str | None = Field(None, validation_alias="submission_id")
    status: JobStatus
    entrypoint: str = ""
    message: str | None = None
    metadata: dict[str, str] | None = None
    start_time: int | None = None
    end_time: int | None = None
    exit_code: int | None = Field(None, validation_alias="driver_exit_code")

    @property
    def ended(self) -> bool:
        """Whether nothing of it runs any more."""
        return self.status not in (JobStatus.PENDING, JobStatus.RUNNING)

    @property
    def since(self) -> datetime | None:
        """When it was submitted."""
        return (
            None if self.start_time is None else datetime.fromtimestamp(self.start_time / 1e3, UTC)
        )

    def lasted(self, now: datetime) -> timedelta | None:
        """Time from its submission to its end, or until now."""
        if self.since is None:
            return None
        return max((_moment(self.end_time) or now) - self.since, timedelta())

    def noted(self, key: str) -> str:
        """What was noted under a key; empty for nothing."""
        return (self.metadata or {}).get(key, "")


class Jobs:
    """The jobs of a cluster.

    Args:
        head: The cluster.
    """

    def __init__(self, head: Head) -> None:
        self.head = head

    def ray_version(self) -> str:
        """Of the cluster; the first thing to ask, since it tells whether there is one."""
        return str(self.head.get("/api/version").get("ray_version"))

    def submit(
        self,
        job_id: str,
        entrypoint: str,
        metadata: Mapping[str, str],
        files: Mapping[str, str] | None = None,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        """Send a job; nothing is installed for it.

        Args:
            job_id: Its id.
            entrypoint: Its command, for a shell on the cluster's head.
            metadata: What is noted on it; no secrets, since everyone who may list jobs sees it.
            files: Texts by name that lie in the folder in which the command starts.
            environment: Variables that it has besides the cluster's; no secrets.

        Raises:
            JobExistsError: There is a job of this id.
            ClusterError: The cluster does not take it.
        """
        runtime: dict[str, Any] = {
            "env_vars": {STOP_WAIT_VARIABLE: str(STOP_WAIT_S), **(environment or {})}
        }
        if files:
            package = Package.of(files)
            package.upload(self.head)
            runtime["working_dir"] = package.uri
        request = {
            "submission_id": job_id,
            "entrypoint": entrypoint,
            "metadata": dict(metadata),
            "runtime_env": runtime,
        }
        answer = self.head.ask("POST", "/api/jobs/", request)
        if answer.status != 200 and f"{job_id} already exists" in answer.text:
            raise JobExistsError(
                f"cluster {self.head.url}: it has a job {job_id!r} already; choose another id"
            )
        if answer.status != 200:
            raise self._failed(f"it does not take job {job_id!r}", answer)

    def list(self) -> list[Job]:
        """All jobs, submitted or not, in the order of their begin."""
        listed = [Job.model_validate(each) for each in self.head.get("/api/jobs/")]
        return sorted(listed, key=lambda job: job.start_time or 0)

    def get(self, job_id: str) -> Job:
        """A job.

        Raises:
            UnknownJobError: There is none of this id.
        """
        return Job.model_validate(self.head.decoded(self._of(job_id, "GET", "")))

    def log(self, job_id: str) -> str:
        """All that a job has written so far.

        Raises:
            UnknownJobError: There is none of this id.
        """
        return str(self.head.decoded(self._of(job_id, "GET", "/logs"))["logs"])

    def follow(self, job_id: str, heard: Callable[[str], None]) -> Job:
        """Hand on what a job has written and writes, line by line, until it ends.

        Args:
            job_id: The job.
            heard: Takes each line, without its end.

        Returns:
            The job, ended.

        Raises:
            UnknownJobError: There is none of this id.
            ClusterLostError: The head does not answer any more.
        """
        self.get(job_id)
        lines = _Lines(heard)
        lost_at: float | None = None
        while True:
            try:
                lines.begin()
                self.head.listen(f"/api/jobs/{quote(job_id)}/logs/tail", lines.take)
                job = self.get(job_id)
                lost_at = None
                if job.ended:
                    lines.end()
                    return job
            except ClusterLostError:
                lost_at = lost_at or time.monotonic()
                if time.monotonic() - lost_at > RECONNECT_S:
                    lines.end()
                    raise
            time.sleep(AGAIN_S)

    def stop(self, job_id: str) -> bool:
        """Ask a job to end, as with SIGTERM; returns whether there was something to ask.

        Raises:
            UnknownJobError: There is none of this id.
        """
        return bool(self.head.decoded(self._of(job_id, "POST", "/stop"))["stopped"])

    def await_end(self, job_id: str, within_s: float, *, stopping: bool = False) -> Job:
        """Wait until a job has ended, or for so long; returns it as it is then.

        Args:
            job_id: The job.
            within_s: Longest wait (s).
            stopping: Ask it to end until it can be asked: one that is only begun cannot.
        """
        until = time.monotonic() + within_s
        while not (job := self.get(job_id)).ended and time.monotonic() < until:
            stopping = stopping and not self.stop(job_id)
            time.sleep(AGAIN_S / 4)
        return job

    def _of(self, job_id: str, method: str, what: str) -> Answer:
        answer = self.head.ask(method, f"/api/jobs/{quote(job_id, safe='')}{what}")
        if answer.status == 404:
            raise UnknownJobError(
                f"cluster {self.head.url}: it knows no job {job_id!r}: another cluster's, or its "
                "head was started anew and has forgotten it; `lmtr jobs` lists those it knows"
            )
        if answer.status != 200:
            raise self._failed(f"it tells nothing of job {job_id!r}", answer)
        return answer

    def _failed(self, what: str, answer: Answer) -> ClusterError:
        return ClusterError(
            f"cluster {self.head.url}: {what}: {answer.reason}; a cluster that has just started "
            "takes some seconds, else look at the log of its head"
        )


def _moment(milliseconds: int | None) -> datetime | None:
    """A time that Ray tells; 0 stands for none."""
    return datetime.fromtimestamp(milliseconds / 1e3, UTC) if milliseconds else None


class _Lines:
    """Cuts a stream of text into lines, and skips what was heard when it begins again."""

    def __init__(self, heard: Callable[[str], None]) -> None:
        self._heard = heard
        self._rest = ""
        self._taken = 0
        self._skip = 0

    def begin(self) -> None:
        """The stream begins at its first letter, once more."""
        self._skip = self._taken

    def take(self, text: str) -> None:
        """Hear a piece."""
        known, self._skip = text[: self._skip], max(0, self._skip - len(text))
        fresh = text[len(known) :]
        self._taken += len(fresh)
        *lines, self._rest = (self._rest + fresh).split("\n")
        for line in lines:
            self._heard(line)

    def end(self) -> None:
        """Hear what has no end of line."""
        if self._rest:
            self._heard(self._rest)
            self._rest = ""
