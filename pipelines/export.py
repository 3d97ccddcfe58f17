"""Exports to Parquet: sampled solutions, sampled rollouts, segments (contract: docs/data.md)."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from lmtr.errors import ConfigurationError
from lmtr.robot.model import FEET
from lmtr.trajectory.motion import Motion, sampled
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT
from pipelines import records
from pipelines.progress import bar
from pipelines.records import Row
from pipelines.workspace import Workspace
from services.files import whole_file
from services.lake.schemas import SCHEMAS

SAMPLES = [pa.field("t", pa.float64())] + [
    pa.field(column, pa.list_(pa.bool_() if column == "foot_contact" else pa.float64()))
    for column, _, _ in records.MOTION_COLUMNS
]
"""One sample: s, m, rad, m/s, rad/s, m, N; feet LF, RF, LH, RH; world frame."""

SOLUTIONS = pa.schema(
    [pa.field("dataset_id", pa.string()), pa.field("solution_index", pa.int64()), *SAMPLES]
)
ROLLOUTS = pa.schema(
    [pa.field("rollout_id", pa.string()), pa.field("replanner", pa.string()), *SAMPLES]
)
FOOTHOLDS = pa.schema(
    [
        pa.field("rollout_id", pa.string()),
        pa.field("foot", pa.string()),
        *(pa.field(name, pa.float64()) for name in ("x", "y", "t_touchdown", "t_liftoff")),
    ]
)
OBSTACLES = pa.schema(
    [
        pa.field("rollout_id", pa.string()),
        *(pa.field(name, pa.float64()) for name in ("x", "y", "alpha")),
    ]
)


def export_solutions(
    workspace: Workspace, out: Path, dt: float, where: str | None, limit: int | None
) -> int:
    """Write one row per solution and sample time; returns the number of rows.

    Solutions without a trajectory (their work failed) have no samples.

    Raises:
        ConfigurationError: ``dt`` is not finite.
    """
    if not np.isfinite(dt):
        raise ConfigurationError(f"export: --dt must be a finite time, got {dt}; name seconds")
    rows = _rows(workspace, "solutions", "dataset_id, index", where, limit)
    with _parquet(out, SOLUTIONS) as file:
        for row in rows:
            if row["base_nodes"]:
                head = {"dataset_id": row["dataset_id"], "solution_index": row["index"]}
                motion = sampled(records.trajectory_of(row), dt)
                file.write(_samples(motion, head, SOLUTIONS))
    return file.rows


def export_rollouts(workspace: Workspace, out: Path, where: str | None, limit: int | None) -> int:
    """Write one row per rollout and 0.1 s sample, footholds and obstacles in files beside it.

    Rollouts whose motion was not kept are left out.
    """
    where = "len(t) > 0" if where is None else f"({where}) AND len(t) > 0"
    rows = _rows(workspace, "rollouts", "rollout_id", where, limit)
    with (
        _parquet(out, ROLLOUTS) as file,
        _parquet(_beside(out, "footholds"), FOOTHOLDS) as footholds,
        _parquet(_beside(out, "obstacles"), OBSTACLES) as obstacles,
    ):
        for row in rows:
            rollout_id, motion = row["rollout_id"], records.motion_of(row)
            head = {"rollout_id": rollout_id, "replanner": row["replanner"]}
            file.write(_samples(motion, head, ROLLOUTS))
            footholds.write(_footholds(motion, rollout_id))
            lines = records.obstacles_of(row)
            obstacles.write(_constant({"rollout_id": rollout_id}, lines.T, OBSTACLES))
    return file.rows


def export_segments(workspace: Workspace, out: Path, where: str | None, limit: int | None) -> int:
    """Write x and τ with their layouts in the file's metadata; returns the number of rows."""
    layouts = {
        b"lmtr.task_layout": records.to_json(TASK_LAYOUT.metadata()).encode(),
        b"lmtr.segment_layout": records.to_json(SEGMENT_LAYOUT.metadata()).encode(),
    }
    schema = SCHEMAS["segments"]
    schema = schema.with_metadata({**(schema.metadata or {}), **layouts})
    order = "dataset_id, segmentation_id, solution_index, epoch_s, goal_time_s"
    batches = workspace.lake.batches("segments", where=where, order_by=order, limit=limit)
    with _parquet(out, schema) as file:
        for batch in batches:
            file.write(batch.cast(schema))
    return file.rows


def export_segments_npz(
    workspace: Workspace, out: Path, where: str | None, limit: int | None
) -> int:
    """Write x, τ and their keys as NumPy arrays, with both layouts as JSON; returns the rows.

    All rows are in memory at once.
    """
    order = "dataset_id, segmentation_id, solution_index, epoch_s, goal_time_s"
    rows = workspace.lake.read("segments", where=where, order_by=order, limit=limit)
    arrays = {name: rows[name].to_numpy() for name in ("solution_index", "epoch_s", "goal_time_s")}
    for name in ("dataset_id", "segmentation_id", "split"):
        arrays[name] = np.array(rows[name].to_pylist(), dtype=np.str_)
    for name in ("x", "tau"):
        values = rows[name].combine_chunks().flatten().to_numpy(zero_copy_only=False)
        arrays[name] = values.reshape(rows.num_rows, -1)
    layouts = {"task": TASK_LAYOUT.metadata(), "segment": SEGMENT_LAYOUT.metadata()}
    arrays["layouts"] = np.array(records.to_json(layouts))
    with whole_file(out) as partial, partial.open("wb") as file:
        np.savez(file, **arrays)
    return int(rows.num_rows)


def _beside(out: Path, name: str) -> Path:
    """FILE.name.parquet beside FILE.parquet."""
    return out.with_name(f"{out.name.removesuffix('.parquet')}.{name}.parquet")


class _Parquet:
    """Rows written to a Parquet file, and how many they were."""

    def __init__(self, writer: pq.ParquetWriter) -> None:
        self._writer = writer
        self.rows = 0

    def write(self, table: pa.Table) -> None:
        """Add rows."""
        self._writer.write_table(table)
        self.rows += table.num_rows


@contextmanager
def _parquet(path: Path, schema: pa.Schema) -> Iterator[_Parquet]:
    """A Parquet file to add rows to, which appears under its name only when it is whole."""
    with whole_file(path) as partial, pq.ParquetWriter(partial, schema) as writer:
        yield _Parquet(writer)


def _rows(
    workspace: Workspace, table: str, order: str, where: str | None, limit: int | None
) -> Iterator[Row]:
    """Rows of a table, read a batch at a time, with a progress bar."""
    batches = workspace.lake.batches(table, where=where, order_by=order, limit=limit)
    with bar(f"Exporting {table}", limit) as progress:
        for batch in batches:
            for row in batch.to_pylist():
                yield row
                progress.advance()


def _samples(motion: Motion, head: Row, schema: pa.Schema) -> pa.Table:
    """Samples of one motion as rows, each with the constant columns of ``head``."""
    count = len(motion.times)
    arrays = [motion.times] + [
        np.asarray(getattr(motion, name)).reshape(count, -1)
        for _, name, _ in records.MOTION_COLUMNS
    ]
    return _constant(head, arrays, schema)


def _footholds(motion: Motion, rollout_id: str) -> pa.Table:
    holds = motion.footholds
    names = np.array(FEET)[holds.foot]
    columns = (names, *holds.position_W.T, holds.touchdown, holds.liftoff)
    return _constant({"rollout_id": rollout_id}, columns, FOOTHOLDS)


def _constant(head: Row, columns: Iterable[NDArray[Any]], schema: pa.Schema) -> pa.Table:
    """A table of ``columns`` behind columns that repeat the values of ``head``."""
    lists = [column.tolist() for column in columns]
    repeated = [[value] * len(lists[0]) for value in head.values()]
    arrays = [
        pa.array(values, field.type)
        for values, field in zip([*repeated, *lists], schema, strict=True)
    ]
    return pa.table(arrays, schema=schema)
