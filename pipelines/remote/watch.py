"""How a submitted job goes on: its log as it grows, its end, and stopping it."""

from contextlib import ExitStack
from datetime import UTC, datetime, timedelta

from rich.console import Console
from rich.live import Live
from rich.text import Text

from pipelines.progress import Progressed, say
from pipelines.remote.submission import COMMAND
from pipelines.remote.target import Target
from pipelines.terminal import printable
from services.cluster.jobs import STOP_WAIT_S, Job, JobStatus
from services.errors import ClusterError, ClusterLostError, LeftRunningError, UnknownJobError

INTERRUPTED = "lmtr: interrupted"
"""How the last line of a command begins that was stopped and has finished what was under way."""

SLACK_S = 30.0
"""A job that was stopped is killed in time; so much longer its end may take to be noted."""


class LogView:
    """Shows a log: in a terminal lines of progress take each other's place at the bottom."""

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(highlight=False)
        self._stack = ExitStack()
        self._live: Live | None = None

    def __enter__(self) -> "LogView":
        if self._console.is_terminal:
            self._live = self._stack.enter_context(Live(console=self._console, transient=True))
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def line(self, written: str) -> None:
        """Show a line that somebody's job wrote, without what would steer the terminal."""
        text = printable(written)
        if self._live is not None and Progressed.read(text) is not None:
            self._live.update(Text(text, no_wrap=True, overflow="ellipsis"))
        else:
            self._console.print(text, markup=False, soft_wrap=True)


def show_log(target: Target, job_id: str, lines: int | None = None) -> None:
    """Show what a job has written so far, or the last lines of it.

    Raises:
        ClusterError: The cluster does not answer, or does not know the job.
    """
    written = target.jobs.log(job_id).splitlines()
    with LogView(Console(highlight=False, force_terminal=False)) as view:
        for line in written if lines is None else written[-lines:] if lines else []:
            view.line(line)


def follow(target: Target, job_id: str, command: str = "") -> None:
    """Show a job's log until it ends well.

    Args:
        target: Its cluster.
        job_id: The job.
        command: What it was submitted with.

    Raises:
        ClusterError: It failed or was stopped, or the cluster is lost.
        LeftRunningError: Ctrl-C: the job goes on.
    """
    mend = f"submit again to go on: {command}" if command else "submit the same again to go on"
    try:
        with LogView() as view:
            job = target.jobs.follow(job_id, view.line)
    except KeyboardInterrupt as error:
        raise LeftRunningError(
            f"job {job_id} goes on without you; follow it again with "
            f"`{target.command('logs', job_id, '-f')}`, stop it with "
            f"`{target.command('cancel', job_id)}`"
        ) from error
    except (ClusterLostError, UnknownJobError) as error:
        raise type(error)(f"{error}; what was committed is kept: {mend}") from error
    _require_success(target, job, command or job.noted(COMMAND))


def cancel(target: Target, job_id: str) -> None:
    """Stop a job such that it finishes and keeps what is under way, and say what became of it.

    Raises:
        ClusterError: The cluster does not answer, does not know the job, or does not stop it.
        LeftRunningError: Ctrl-C: the job is being stopped all the same.
    """
    job = target.jobs.get(job_id)
    if job.ended:
        say(f"job {job_id} had ended already: {job.status.lower()}")
        return
    say(f"stopping {job_id}: what is under way is finished and kept, which may take a while")
    try:
        job = target.jobs.await_end(job_id, STOP_WAIT_S + SLACK_S, stopping=True)
    except KeyboardInterrupt as error:
        raise LeftRunningError(
            f"job {job_id} is being stopped all the same; see `{target.command('jobs')}`"
        ) from error
    if not job.ended:
        raise ClusterError(
            f"job {job_id} has not ended within {STOP_WAIT_S + SLACK_S:.0f} s; look at "
            f"`{target.command('logs', job_id, '-n', '20')}` and cancel it again"
        )
    say(_told_end(job, target.jobs.log(job_id)))


def _told_end(job: Job, log: str) -> str:
    """What became of a job that was to be stopped."""
    again = job.noted(COMMAND)
    going_on = f"; to go on: {again}" if again else ""
    if job.status is not JobStatus.STOPPED:
        return f"job {job.id} had {job.status.lower()} before it could be stopped"
    lines = [line for line in log.splitlines() if line.strip()]
    if not lines or not lines[-1].startswith(INTERRUPTED):
        return (
            f"job {job.id} was ended by force or before its work began; what was committed is "
            f"kept{going_on}"
        )
    said = [line for line in lines[:-1] if Progressed.read(line) is None]
    last = f" ({said[-1].partition('; go on with')[0]})" if said else ""
    return f"job {job.id} finished what was under way and stopped{last}{going_on}"


def _require_success(target: Target, job: Job, command: str) -> None:
    lasted = spoken(job.lasted(datetime.now(UTC)))
    if job.status is JobStatus.SUCCEEDED:
        say(f"job {job.id} succeeded after {lasted}")
        return
    again = f"submit again to go on: {command}" if command else "submit the same again to go on"
    if job.status is JobStatus.STOPPED:
        raise ClusterError(f"job {job.id} was stopped after {lasted}; {again}")
    written = [line for line in target.jobs.log(job.id or "").splitlines() if line.strip()]
    last = printable(written[-1]).removeprefix("lmtr: ") if written else ""
    why = last or job.message or "it says nothing"
    raise ClusterError(f"job {job.id} failed after {lasted}: {why}; mend that and {again}")


def spoken(time: timedelta | None) -> str:
    """A duration for people: its two largest units."""
    if time is None:
        return "?"
    seconds = round(time.total_seconds())
    days, hours, minutes = seconds // 86400, seconds // 3600 % 24, seconds // 60 % 60
    if days:
        return f"{days} d {hours} h"
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {seconds % 60} s" if minutes else f"{seconds} s"
