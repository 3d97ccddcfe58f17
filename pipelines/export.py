"""Exports to Parquet: sampled solutions, sampled rollouts, segments (contract: docs/data.md)."""

import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from lmtr.errors import DataError
from lmtr.robot.model import FEET
from lmtr.trajectory.motion import Motion, sampled
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT
from pipelines import records
from pipelines.progress import bar
from pipelines.records import Row
from pipelines.workspace import Workspace
from services.lake.schemas import SCHEMAS

DOUBLES = pa.list_(pa.float64())

SAMPLE_FIELDS = [
    pa.field("t", pa.float64()),
    pa.field("base_pos_W", DOUBLES),
    pa.field("base_rpy", DOUBLES),
    pa.field("base_linvel_W", DOUBLES),
    pa.field("base_angvel_W", DOUBLES),
    pa.field("foot_pos_W", DOUBLES),
    pa.field("foot_force_W", DOUBLES),
    pa.field("foot_contact", pa.list_(pa.bool_())),
]
"""One sample: s, m, rad, m/s, rad/s, m, N; feet LF, RF, LH, RH; world frame."""

SOLUTIONS = pa.schema(
    [pa.field("dataset_id", pa.string()), pa.field("solution_index", pa.int64()), *SAMPLE_FIELDS]
)
ROLLOUTS = pa.schema(
    [pa.field("rollout_id", pa.string()), pa.field("replanner", pa.string()), *SAMPLE_FIELDS]
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
    """
    rows = _rows(workspace, "solutions", "dataset_id, index", where, limit)
    with _Parquet(out, SOLUTIONS) as file:
        for row in rows:
            if row["base_nodes"]:
                head = {"dataset_id": row["dataset_id"], "solution_index": row["index"]}
                motion = sampled(records.trajectory_of(row), dt)
                file.write(_samples(motion, head, SOLUTIONS))
    return file.rows


def export_rollouts(workspace: Workspace, out: Path, where: str | None, limit: int | None) -> int:
    """Write one row per rollout and 0.1 s sample, footholds and obstacles in files beside it."""
    rows = _rows(workspace, "rollouts", "rollout_id", where, limit)
    with (
        _Parquet(out, ROLLOUTS) as file,
        _Parquet(_beside(out, "footholds"), FOOTHOLDS) as footholds,
        _Parquet(_beside(out, "obstacles"), OBSTACLES) as obstacles,
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
    with _Parquet(out, schema) as file:
        for batch in batches:
            file.write(batch.cast(schema))
    return file.rows


def _beside(out: Path, name: str) -> Path:
    """FILE.name.parquet beside FILE.parquet."""
    return out.with_name(f"{out.name.removesuffix('.parquet')}.{name}.parquet")


class _Parquet:
    """A Parquet file that appears under its name only when it is whole."""

    def __init__(self, path: Path, schema: pa.Schema) -> None:
        self._path = path
        self._partial = path.with_name(f".{path.name}.partial")
        self._schema = schema
        self.rows = 0

    def __enter__(self) -> "_Parquet":
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = pq.ParquetWriter(self._partial, self._schema)
        except OSError as error:
            raise DataError(
                f"export: {self._path} cannot be written ({error}); name another --out"
            ) from error
        return self

    def write(self, table: pa.Table) -> None:
        """Add rows."""
        self._writer.write_table(table)
        self.rows += table.num_rows

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._writer.close()
        if kind is None:
            os.replace(self._partial, self._path)
        else:
            self._partial.unlink(missing_ok=True)


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
    arrays = (
        motion.times,
        motion.base_position_W,
        motion.base_rpy,
        motion.base_velocity_W,
        motion.base_angular_velocity_W,
        motion.foot_position_W.reshape(len(motion.times), -1),
        motion.foot_force_W.reshape(len(motion.times), -1),
        motion.contact,
    )
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
