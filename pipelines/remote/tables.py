"""What there is to see of a cluster: its machines, its jobs, and how far these are."""

import json
from collections.abc import Sequence
from datetime import UTC, datetime

from rich.console import Console
from rich.table import Table
from rich.text import Text

from pipelines.progress import Progressed
from pipelines.remote.submission import CONFIGURATION, DATASET, STAGE
from pipelines.remote.target import Target
from pipelines.remote.versions import PURPOSE
from pipelines.remote.watch import spoken
from pipelines.terminal import printable, printable_text
from services.cluster.jobs import Job
from services.cluster.nodes import Node, nodes

GIB = 2**30

STYLES = {"RUNNING": "green", "FAILED": "red", "STOPPED": "yellow", "DEAD": "red", "ALIVE": "green"}


def show_jobs(target: Target, *, form_json: bool = False, all_jobs: bool = False) -> None:
    """List the jobs that were submitted, the oldest first.

    Args:
        target: The cluster.
        form_json: As JSON, for programs.
        all_jobs: Also those that only ask for versions, and those of others.

    Raises:
        ClusterError: The cluster does not answer.
    """
    listed = [job for job in target.jobs.list() if job.id and (all_jobs or _is_work(job))]
    now = datetime.now(UTC)
    if form_json:
        print(json.dumps([_plain(job, now) for job in listed], indent=2))
        return
    if not listed:
        print(f"no jobs at {target.url}; `lmtr submit --help` says how to send one")
        return
    table = _table("id", "stage", "status", "submitted", "duration", "configuration")
    for job in listed:
        _add_row(
            table,
            job.id or "-",
            job.noted(STAGE) or "-",
            Text(job.status.lower(), STYLES.get(job.status, "")),
            _local(job.since),
            spoken(job.lasted(now)),
            job.noted(CONFIGURATION) or "-",
        )
    _wide_console().print(table)


def show_status(target: Target) -> None:
    """Show machines and the jobs that run, with what these last said of their progress.

    Raises:
        ClusterError: The cluster does not answer.
    """
    ray_version = target.jobs.ray_version()
    console, now = _wide_console(), datetime.now(UTC)
    console.print(printable(f"{target.url}: Ray {ray_version}"), markup=False)
    console.print(_node_table(nodes(target.jobs.head), now))
    running = [job for job in target.jobs.list() if job.id and not job.ended and _is_work(job)]
    if not running:
        console.print("no jobs run")
        return
    table = _table("running job", "for", "data set", "done", "doing", "lately")
    for job in running:
        at = latest_progress(target.jobs.log(job.id or ""))
        told = ("-", job.status.lower(), "") if at is None else (_count(at), at.title, at.words)
        lasted, dataset = spoken(job.lasted(now)), job.noted(DATASET) or "-"
        _add_row(table, job.id or "-", lasted, dataset, *told)
    console.print(table)


def latest_progress(log: str) -> Progressed | None:
    """What a log last says of progress."""
    found = (Progressed.read(line) for line in reversed(log.splitlines()))
    return next((each for each in found if each is not None), None)


def _node_table(listed: Sequence[Node], now: datetime) -> Table:
    table = _table("node", "address", "state", "since", "processors", "memory (GiB)", "why")
    for node in listed:
        _add_row(
            table,
            node.name + (" (head)" if node.is_head else ""),
            node.ip,
            Text(printable(node.state.lower()), STYLES.get(node.state, "")),
            f"{spoken(now - node.since)} ago",
            _of(node, "CPU", 1.0),
            _of(node, "memory", GIB),
            "" if node.alive else " ".join((node.state_message or "").split())[:80],
        )
    return table


def _of(node: Node, resource: str, unit: float) -> str:
    """How much of a resource is asked for, of how much there is."""
    total = node.resources.get(resource, 0.0) / unit
    if not node.alive:
        return "-"
    used = "?" if node.used is None else f"{node.used.get(resource, 0.0) / unit:.3g}"
    return f"{used} of {total:.3g}"


def _count(at: Progressed) -> str:
    return f"{at.done} of {'?' if at.total is None else at.total}"


def _is_work(job: Job) -> bool:
    return bool(job.noted(STAGE)) and not job.noted(PURPOSE)


def _plain(job: Job, now: datetime) -> dict[str, object]:
    lasted = job.lasted(now)
    return {
        "id": job.id,
        "stage": job.noted(STAGE) or None,
        "status": job.status.lower(),
        "submitted": None if job.since is None else job.since.isoformat(timespec="seconds"),
        "duration_s": None if lasted is None else round(lasted.total_seconds(), 1),
        "configuration": job.noted(CONFIGURATION) or None,
        "dataset_id": job.noted(DATASET) or None,
        "exit_code": job.exit_code,
        "entrypoint": job.entrypoint,
        "metadata": job.metadata or {},
    }


def _local(moment: datetime | None) -> str:
    return "?" if moment is None else moment.astimezone().strftime("%Y-%m-%d %H:%M:%S")


def _table(*columns: str) -> Table:
    table = Table(header_style="bold", box=None, pad_edge=False)
    for column in columns:
        table.add_column(column, overflow="fold")
    return table


def _add_row(table: Table, *cells: str | Text) -> None:
    """Add cells of which the texts come from others."""
    table.add_row(*(printable_text(cell) if isinstance(cell, str) else cell for cell in cells))


def _wide_console() -> Console:
    """A file or a pipe gets whole lines, so that they can be searched."""
    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=200)
