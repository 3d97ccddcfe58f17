"""What limits a generation at 10, 100 and 1,000 nodes: measured figures and a simulation.

    python benchmarks/scaling.py --out build/scaling --record

The first part measures one writer on this machine: how long a commit takes by its rows, what a row,
a log entry and a checkpoint take on disk, how fast files are joined, and how many batches a second
one driver can hand out. The second part lets any number of workers produce rows for that writer,
batch by batch, and says where rows pile up.
"""

import heapq
import json
import shutil
import time
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import numpy as np
import pyarrow as pa
import typer
from rich.console import Console
from rich.table import Table

from services.lake.appender import Appender, Group
from services.lake.digest import sealed
from services.lake.schemas import SCHEMAS
from services.lake.tables import Lake

RESULTS = Path(__file__).parent / "results" / "scaling.json"

CORES_PER_NODE = 64
SOLVE_S = 0.25
"""Wall time of a solution on one core, checks included (s): docs/benchmarks.md."""

BATCH_S = 2.0
COMMIT_S = 10.0

# Prices ($): of a core for an hour, a thousand writes to and reads of a store.
CORE_HOUR = 0.04
THOUSAND_WRITES = 0.005
THOUSAND_READS = 0.0004


@dataclass(frozen=True)
class Writer:
    """What was measured of a writer.

    Attributes:
        commit_s: Time of a commit without rows (s).
        row_s: Time that each row adds (s).
        row_bytes: A solution on disk.
        entry_bytes: A log entry.
        file_bytes: What a checkpoint holds of each file.
        join_bytes_s: Bytes per second that compaction joins.
    """

    commit_s: float
    row_s: float
    row_bytes: float
    entry_bytes: float
    file_bytes: float
    join_bytes_s: float


@dataclass(frozen=True)
class Load:
    """What came of a simulated run.

    Attributes:
        nodes: Nodes, of ``CORES_PER_NODE`` workers each.
        writers: Writers, each with its own share of the indices.
        produced: Rows per second that workers could make.
        kept: Rows per second that were kept.
        busy: Share of the time that a writer commits.
        rows: Rows of a commit, median.
        commits: Commits per hour.
    """

    nodes: int
    writers: int
    produced: float
    kept: float
    busy: float
    rows: float
    commits: float


def main(
    out: Annotated[Path, typer.Option(help="Folder for the tables that are measured.")],
    record: Annotated[bool, typer.Option(help="Keep the figures for the docs.")] = False,
) -> None:
    """Measure, simulate, print."""
    console = Console()
    writer = measure(out)
    console.print(writer)
    loads = [
        simulate(nodes, writers, writer)
        for nodes, writers in ((1, 1), (10, 1), (100, 1), (100, 4), (1000, 1), (1000, 32))
    ]
    console.print(_table(loads, writer))
    if record:
        found = {"writer": asdict(writer), "loads": [asdict(load) for load in loads]}
        RESULTS.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


def measure(out: Path) -> Writer:
    """Commit rows of the size of real ones, few and many at a time."""
    place = out / "lake"
    shutil.rmtree(place, ignore_errors=True)
    lake = Lake(place)
    appender = Appender(lake, Group("solutions", {"dataset_id": "scale"}, "index"))
    sizes = [10, 1000, 4000] * 4
    seconds, start = [], 0
    for size in sizes:
        rows = rows_like_solutions(start, size)
        began = time.perf_counter()
        appender.append(rows)
        seconds.append(time.perf_counter() - began)
        start += size
    row_s, commit_s = np.polyfit(sizes[3:], seconds[3:], 1)
    folder = place / "solutions"
    stored = sum(file.stat().st_size for file in folder.glob("*.parquet"))
    entries = [f.stat().st_size for f in (folder / "_delta_log").glob("*.json")]
    began = time.perf_counter()
    lake.compact("solutions")
    joined = time.perf_counter() - began
    (checkpoint,) = (folder / "_delta_log").glob("*.checkpoint.parquet")
    return Writer(
        commit_s=float(commit_s),
        row_s=float(row_s),
        row_bytes=stored / start,
        entry_bytes=float(np.median(entries)),
        file_bytes=checkpoint.stat().st_size / (len(sizes) + 1),
        join_bytes_s=stored / joined,
    )


def rows_like_solutions(start: int, count: int) -> pa.Table:
    """Rows as large as solutions of the default settings, of numbers that do not compress."""
    rng = np.random.default_rng(start)
    lists = {
        "base_nodes": 912,
        "contact_times": 56,
        "footholds": 84,
        "swing_nodes": 120,
        "force_nodes": 504,
        "guess_footholds": 84,
    }
    rows = [
        {
            "dataset_id": "scale",
            "index": index,
            "status": "converged",
            "accepted": True,
            "reject_reasons": [],
            "cost_terms": [],
            "constraint_violation": [],
            "violations": [(f"violation_{k}", value) for k, value in enumerate(rng.random(30))],
            "code_version": "0",
            "config_hash": "0",
            "created_at": datetime.now(UTC),
            **{name: rng.random(size) for name, size in lists.items()},
        }
        for index in range(start, start + count)
    ]
    return sealed("solutions", pa.Table.from_pylist(rows, schema=SCHEMAS["solutions"]))


def simulate(nodes: int, writers: int, writer: Writer, duration: float = 600.0) -> Load:
    """Workers of many nodes, and a share of them for each writer; time in seconds.

    A worker hands in a batch every ``BATCH_S``; a writer that is free commits what has come in as
    soon as that is ``COMMIT_S`` old or 500 rows; workers pause while 64 MB wait.
    """
    workers = nodes * CORES_PER_NODE // writers
    batch = BATCH_S / SOLVE_S
    most = 64e6 / writer.row_bytes
    rng = np.random.default_rng(0)
    due = [float(at) for at in rng.uniform(0.0, BATCH_S, workers)]
    heapq.heapify(due)
    waiting, since, free_at, kept, busy = 0.0, 0.0, 0.0, 0.0, 0.0
    sizes: list[float] = []
    now = 0.0
    while now < duration:
        now = heapq.heappop(due)
        if now >= free_at and waiting and (waiting >= 500 or now - since >= COMMIT_S):
            taken = writer.commit_s + writer.row_s * waiting
            free_at, busy, kept = now + taken, busy + taken, kept + waiting
            sizes.append(waiting)
            waiting = 0.0
        if waiting + batch > most:  # the worker waits until the writer is free
            heapq.heappush(due, max(free_at, now) + 1e-3)
            continue
        since = now if not waiting else since
        waiting += batch
        heapq.heappush(due, now + BATCH_S * rng.uniform(0.8, 1.2))
    return Load(
        nodes,
        writers,
        produced=nodes * CORES_PER_NODE / SOLVE_S,
        kept=kept * writers / now,
        busy=busy / now,
        rows=float(np.median(sizes)),
        commits=len(sizes) * writers / now * 3600.0,
    )


def _table(loads: list[Load], writer: Writer) -> Table:
    """Loads and what they cost; files are joined by a thread beside each writer's commits."""
    table = Table(
        "nodes", "writers", "made /s", "kept /s", "writer busy", "joining", "rows a commit",
        "commits /h",
        "log MB /day", "TB /day", "$ a million", "of it requests",
    )  # fmt: skip
    for load in loads:
        # A commit: one data file, one log entry; some reads to catch up; a checkpoint of 100.
        commits = 1e6 / load.rows
        requests = commits * (2.1 * THOUSAND_WRITES + 6 * THOUSAND_READS) / 1000.0
        cost = 1e6 * SOLVE_S / 3600.0 * CORE_HOUR * max(1.0, load.produced / load.kept) + requests
        table.add_row(
            f"{load.nodes}",
            f"{load.writers}",
            f"{load.produced:,.0f}",
            f"{load.kept:,.0f}",
            f"{load.busy:.0%}",
            f"{load.kept / load.writers * writer.row_bytes / writer.join_bytes_s:.0%}",
            f"{load.rows:,.0f}",
            f"{load.commits:,.0f}",
            f"{24 * load.commits * writer.entry_bytes / 1e6:,.0f}",
            f"{86400 * load.kept * writer.row_bytes / 1e12:,.2f}",
            f"{cost:.2f}",
            f"{requests:.2f}",
        )
    return table


if __name__ == "__main__":
    typer.run(main)
