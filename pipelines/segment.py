"""Stage 2: cut accepted solutions into segments (x, τ)."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from lmtr.segmentation.segment import Segments, segment_solution
from lmtr.task.sampling import stream
from pipelines import records
from pipelines.config import Configuration
from pipelines.datasets import dataset_seed
from pipelines.progress import bar, say
from pipelines.workspace import Workspace
from services.lake.schemas import SCHEMAS

BATCH_SOLUTIONS = 50

STREAM_SEGMENTS = 1
"""Second part of the key of a solution's segmentation stream."""

GOLDEN_RATIO = 0.6180339887498949


@dataclass(frozen=True)
class Segmented:
    """What the stage left in the lake.

    Attributes:
        dataset_id: The data set.
        segmentation_id: How it was cut.
        segments: Segments of this data set and cut in the table.
        version: Version of the table ``segments``.
    """

    dataset_id: str
    segmentation_id: str
    segments: int
    version: int


def in_validation(index: int, share: float) -> bool:
    """Whether a solution is held out: a golden-ratio sequence spreads them evenly.

    The decision depends on the index alone, so a data set that grows keeps its split, and every
    stretch of indices, however short, holds close to ``share`` of them.
    """
    return (index * GOLDEN_RATIO) % 1.0 < share


def segment(config: Configuration, workspace: Workspace, dataset_id: str) -> Segmented:
    """Cut the accepted solutions that have not been cut this way before."""
    lake, cut = workspace.lake, config.segmentation_id
    with workspace.home.lock(f"segment-{dataset_id}"):
        missing = _missing(workspace, dataset_id, cut)
        seed = dataset_seed(workspace, dataset_id)
        made = 0
        with bar("Cutting segments", len(missing)) as progress:
            for start in range(0, len(missing), BATCH_SOLUTIONS):
                batch = missing[start : start + BATCH_SOLUTIONS]
                made += _cut_batch(config, workspace, dataset_id, seed, batch)
                progress.advance(len(batch), f"{made} segments")
    total = (
        lake.query_value(f"SELECT count(*) FROM segments WHERE {selection(dataset_id, cut)}")
        if lake.exists("segments")
        else 0
    )
    version = lake.version("segments") if lake.exists("segments") else 0
    say(f"segment: {dataset_id}: {made} new segments, {total} in all; table version {version}")
    return Segmented(dataset_id, cut, total, version)


def selection(dataset_id: str, segmentation_id: str) -> str:
    """SQL condition for the segments of one data set, cut one way."""
    return f"dataset_id = '{dataset_id}' AND segmentation_id = '{segmentation_id}'"


def _missing(workspace: Workspace, dataset_id: str, cut: str) -> list[int]:
    lake = workspace.lake
    accepted = lake.read(
        "solutions", ["index"], where=f"dataset_id = '{dataset_id}' AND accepted", order_by="index"
    )["index"].to_pylist()
    if not lake.exists("segments"):
        return list(accepted)
    done = lake.read("segments", ["solution_index"], where=selection(dataset_id, cut))
    return sorted(set(accepted) - set(done["solution_index"].to_pylist()))


def _cut_batch(
    config: Configuration, workspace: Workspace, dataset_id: str, seed: int, batch: list[int]
) -> int:
    lake, cut = workspace.lake, config.segmentation_id
    indices = ", ".join(map(str, batch))
    rows = lake.read(
        "solutions",
        where=f"dataset_id = '{dataset_id}' AND index IN ({indices})",
        order_by="index",
    ).to_pylist()
    share = config.training.validation_share
    tables = []
    for row in rows:
        segments = segment_solution(
            records.trajectory_of(row),
            records.task_of(row).obstacles_W,
            config.segmentation,
            stream(seed, row["index"], STREAM_SEGMENTS),
        )
        split = "validation" if in_validation(row["index"], share) else "train"
        tables.append(_table(segments, dataset_id, row["index"], split, cut))
    table = pa.concat_tables(tables)
    if table.num_rows:
        app_id = f"segments/{dataset_id}/{cut}"
        number = (lake.last_transaction("segments", app_id) or 0) + 1
        lake.append("segments", table, app_id=app_id, number=number)
    return int(table.num_rows)


def _table(
    segments: Segments, dataset_id: str, solution_index: int, split: str, cut: str
) -> pa.Table:
    count = len(segments.epoch_s)
    schema = SCHEMAS["segments"]
    columns = {
        "dataset_id": pa.array([dataset_id] * count, pa.string()),
        "solution_index": pa.array([solution_index] * count, pa.int64()),
        "segmentation_id": pa.array([cut] * count, pa.string()),
        "epoch_s": pa.array(segments.epoch_s),
        "goal_time_s": pa.array(segments.goal_time_s),
        "split": pa.array([split] * count, pa.string()),
        "x": _vectors(segments.x, schema.field("x").type),
        "tau": _vectors(segments.tau, schema.field("tau").type),
    }
    return pa.table([columns[name] for name in schema.names], schema=schema)


def _vectors(array: np.ndarray, kind: pa.DataType) -> pa.Array:
    """Rows of a matrix as an Arrow column of equal lists, without a detour through Python."""
    values = pa.array(np.ascontiguousarray(array, dtype=np.float32).ravel())
    if pa.types.is_fixed_size_list(kind):
        return pa.FixedSizeListArray.from_arrays(values, type=kind)
    offsets = np.arange(len(array) + 1, dtype=np.int32) * array.shape[1]
    return pa.ListArray.from_arrays(pa.array(offsets), values).cast(kind)
