"""Stage 2: cut accepted solutions into segments (x, τ)."""

from collections import Counter

import numpy as np
import pyarrow as pa

from lmtr.errors import DataError
from lmtr.segmentation.segment import Segments, segment_solution
from lmtr.segmentation.split import in_validation
from lmtr.streams import Purpose, stream
from pipelines import records
from pipelines.config import Configuration
from pipelines.datasets import configuration_of
from pipelines.progress import bar, say
from pipelines.provenance import code_version
from pipelines.workspace import Workspace
from services.lake.digest import sealed
from services.lake.schemas import SCHEMAS

BATCH_SOLUTIONS = 50


def segment(config: Configuration, workspace: Workspace, dataset_id: str) -> None:
    """Cut the accepted solutions that have not been cut this way before."""
    lake, cut = workspace.lake, config.segmentation_id
    with workspace.home.lock(f"segment-{dataset_id}"):
        _register(config, workspace, dataset_id)
        _require_accepted(workspace, dataset_id)
        missing = _missing(workspace, dataset_id, cut)
        seed = configuration_of(workspace, dataset_id).dataset.seed
        made = 0
        with bar("Cutting segments", len(missing)) as progress:
            for start in range(0, len(missing), BATCH_SOLUTIONS):
                batch = missing[start : start + BATCH_SOLUTIONS]
                made += _cut_batch(config, workspace, dataset_id, seed, batch)
                progress.advance(len(batch), f"{made} segments")
        if made:
            lake.compact("segments")
    total = len(lake.values("segments", "solution_index", selection(dataset_id, cut)))
    say(f"segment: {dataset_id}: {made} new segments, {total} in all")


def _register(config: Configuration, workspace: Workspace, dataset_id: str) -> None:
    """Describe this way of cutting the data set once in ``cuts``."""
    settings = {
        "segmentation": config.segmentation.model_dump(mode="json"),
        "validation_share": config.training.validation_share,
    }
    row = {
        "dataset_id": dataset_id,
        "segmentation_id": config.segmentation_id,
        "settings": records.to_json(settings),
        "code_version": code_version(),
        "created_at": records.now(),
    }
    app_id = f"cuts/{dataset_id}/{config.segmentation_id}"
    workspace.lake.append_rows("cuts", [row], app_id=app_id)


def selection(dataset_id: str, segmentation_id: str) -> str:
    """SQL condition for the segments of one data set, cut one way."""
    return f"dataset_id = '{dataset_id}' AND segmentation_id = '{segmentation_id}'"


def _require_accepted(workspace: Workspace, dataset_id: str) -> None:
    where = f"dataset_id = '{dataset_id}'"
    verdicts = workspace.lake.values("solutions", "accepted", where)
    if any(verdicts):
        return
    reasons = Counter(
        reason
        for found in workspace.lake.values("solutions", "reject_reasons", where)
        for reason in found
    )
    why = ", ".join(f"{reason} {count}" for reason, count in reasons.most_common(3))
    raise DataError(
        f"data set {dataset_id!r}: none of its {len(verdicts)} solutions is accepted ({why}); "
        "change [expert] or [quality], or generate more"
    )


def _missing(workspace: Workspace, dataset_id: str, cut: str) -> list[int]:
    lake = workspace.lake
    accepted = lake.values("solutions", "index", f"dataset_id = '{dataset_id}' AND accepted")
    done = lake.values("segments", "solution_index", selection(dataset_id, cut))
    return sorted(set(accepted) - set(done))


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
            stream(seed, Purpose.SEGMENTS, row["index"]),
        )
        split = "validation" if in_validation(row["index"], share) else "train"
        tables.append(_table(segments, dataset_id, row["index"], split, cut))
    table = pa.concat_tables(tables)
    if table.num_rows:
        app_id = f"segments/{dataset_id}/{cut}"
        number = lake.next_number("segments", app_id)
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
    unsealed = pa.schema([schema.field(name) for name in columns])
    return sealed("segments", pa.table(list(columns.values()), schema=unsealed))


def _vectors(array: np.ndarray, kind: pa.DataType) -> pa.Array:
    """Rows of a matrix as an Arrow column of equal lists, without a detour through Python."""
    values = pa.array(np.ascontiguousarray(array, dtype=np.float32).ravel())
    if pa.types.is_fixed_size_list(kind):
        return pa.FixedSizeListArray.from_arrays(values, type=kind)
    offsets = np.arange(len(array) + 1, dtype=np.int32) * array.shape[1]
    return pa.ListArray.from_arrays(pa.array(offsets), values).cast(kind)
