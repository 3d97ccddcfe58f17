"""Stage 2: cut accepted solutions into segments (x, τ), on workers."""

import functools
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice

import numpy as np
import pyarrow as pa

from lmtr.errors import DataError
from lmtr.segmentation.segment import SegmentationSettings, Segments, segment_solution
from lmtr.segmentation.split import in_validation
from lmtr.streams import Purpose, stream
from pipelines import records
from pipelines.config import Configuration
from pipelines.datasets import configuration_of
from pipelines.production import Plan, produce
from pipelines.progress import say
from pipelines.provenance import code_version
from pipelines.turns import beside_others
from pipelines.workspace import Workspace
from services.cluster.delivery import Note, Trouble
from services.lake.appender import Group
from services.lake.digest import sealed
from services.lake.housekeeping import join_files
from services.lake.queries import query
from services.lake.schemas import SCHEMAS
from services.lake.sink import Receipt
from services.lake.tables import Lake

READ_SOLUTIONS = 200
"""Solutions that are read at once."""

ITEM_SOLUTIONS = 10
"""Solutions that travel to a worker as one item."""

FEW_SOLUTIONS = 1000
"""So many are cut in the time that Ray takes to start."""

CUT_COLUMNS = ("index", "n_stances", "obstacles", *records.TRAJECTORY_COLUMNS)
"""What cutting needs to know of a solution."""


class CutWorker:
    """Cuts solutions of one data set."""

    def __init__(
        self,
        dataset_id: str,
        segmentation_id: str,
        settings: SegmentationSettings,
        seed: int,
        validation_share: float,
    ) -> None:
        self._identity = (dataset_id, segmentation_id)
        self._settings = settings
        self._seed = seed
        self._share = validation_share

    def __call__(self, solutions: pa.Table) -> tuple[pa.Table, Note]:
        """The segments of some solutions, and how many they are."""
        tables = [self._cut(row) for row in solutions.to_pylist()]
        table = pa.concat_tables(tables)
        return table, {"solutions": solutions.num_rows, "segments": table.num_rows}

    @staticmethod
    def pack(tables: Sequence[pa.Table]) -> pa.Table:
        """Segments as one table, each with its digest."""
        return sealed("segments", pa.concat_tables(tables))

    def _cut(self, row: records.Row) -> pa.Table:
        index = row["index"]
        segments = segment_solution(
            records.trajectory_of(row),
            records.obstacles_of(row),
            self._settings,
            stream(self._seed, Purpose.SEGMENTS, index),
        )
        split = "validation" if in_validation(index, self._share) else "train"
        return _table(segments, *self._identity, index, split)


class CutTally:
    """Counts solutions that are cut and segments that come of it."""

    def __init__(self) -> None:
        self.solutions = 0
        self.segments = 0
        self.troubles: Counter[str] = Counter()

    def add(self, note: Note) -> int:
        """Count one item."""
        self.solutions += note["solutions"]
        self.segments += note["segments"]
        return int(note["solutions"])

    def trouble(self, trouble: Trouble) -> int:
        """Count what went wrong and was mended; what was lost is counted when it is made again."""
        self.troubles[trouble.kind] += 1
        again = sum(note["solutions"] for note in trouble.notes)
        self.solutions -= again
        self.segments -= sum(note["segments"] for note in trouble.notes)
        return int(again)

    def kept(self, receipt: Receipt) -> None:
        """Nothing more is counted of a commit."""

    def words(self) -> str:
        """Segments so far."""
        parts = [f"{self.segments} segments"]
        return ", ".join(parts + [f"{n} {kind}" for kind, n in self.troubles.items()])

    def figures(self) -> Mapping[str, str]:
        """For the table's history."""
        return {
            "lmtr.code_version": code_version(),
            "lmtr.solutions": str(self.solutions),
            "lmtr.segments": str(self.segments),
        }


def segment(config: Configuration, workspace: Workspace, dataset_id: str) -> None:
    """Cut the accepted solutions that have not been cut this way before.

    Raises:
        DataError: No solution is accepted, or one cannot be cut.
        HomeError: Another process cuts the same data set, or a repair is at work.
        KeyboardInterrupt: The user stopped it; what was cut is kept.
    """
    lake, cut = workspace.lake, config.segmentation_id
    with beside_others(workspace.home, f"segment-{dataset_id}"):
        _register(config, workspace, dataset_id)
        _require_accepted(workspace, dataset_id)
        tally = CutTally()
        complete = produce(workspace, _plan(config, workspace, dataset_id), tally)
        if tally.segments:
            join_files(lake, "segments")
    total = (
        lake.query_value(f"SELECT count(*) FROM segments WHERE {selection(dataset_id, cut)}")
        if lake.exists("segments")
        else 0
    )
    say(f"segment: {dataset_id}: {tally.segments} new segments, {total} in all")
    if not complete:
        say("segment: stopped before all solutions were cut; run the same command to go on")
        raise KeyboardInterrupt


def _plan(config: Configuration, workspace: Workspace, dataset_id: str) -> Plan[pa.Table]:
    lake, cut = workspace.lake, config.segmentation_id
    accepted = lake.values("solutions", "index", f"dataset_id = '{dataset_id}' AND accepted")
    return Plan(
        title="Cutting segments",
        group=Group(
            "segments",
            {"dataset_id": dataset_id, "segmentation_id": cut},
            "solution_index",
            unique=False,
        ),
        keys=sorted(accepted),
        items=functools.partial(_solutions, lake, dataset_id),
        make_worker=functools.partial(
            CutWorker,
            dataset_id,
            cut,
            config.segmentation,
            configuration_of(workspace, dataset_id).dataset.seed,
            config.training.validation_share,
        ),
        failed=_refuse,
        few=FEW_SOLUTIONS,
        item_keys=ITEM_SOLUTIONS,
    )


def _solutions(lake: Lake, dataset_id: str, indices: Iterator[int]) -> Iterator[pa.Table]:
    """The solutions of these indices, a few at a time; read as they are asked for."""
    while batch := list(islice(indices, READ_SOLUTIONS)):
        listed = ", ".join(map(str, batch))
        rows = lake.read(
            "solutions",
            CUT_COLUMNS,
            where=f"dataset_id = '{dataset_id}' AND index IN ({listed})",
            order_by="index",
        )
        for start in range(0, rows.num_rows, ITEM_SOLUTIONS):
            yield rows.slice(start, ITEM_SOLUTIONS).combine_chunks()


def _refuse(solutions: pa.Table, error: str) -> tuple[pa.Table, Note]:
    indices = solutions["index"].to_pylist()
    raise DataError(
        f"segment: solutions {indices[0]} to {indices[-1]} cannot be cut: {error}; look for a "
        "damaged one with `lmtr lake check`"
    )


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
    lake, where = workspace.lake, f"dataset_id = '{dataset_id}'"
    counts = f"SELECT count(*) AS made, count_if(accepted) AS kept FROM solutions WHERE {where}"
    (found,) = query(lake, counts).to_pylist()
    if found["kept"]:
        return
    reasons = query(
        lake,
        "SELECT reason, count(*) AS times FROM (SELECT unnest(reject_reasons) AS reason, "
        f"generate_subscripts(reject_reasons, 1) AS place FROM solutions WHERE {where}) "
        "GROUP BY reason ORDER BY times DESC, min(place), reason LIMIT 3",
    )
    why = ", ".join(f"{each['reason']} {each['times']}" for each in reasons.to_pylist())
    raise DataError(
        f"data set {dataset_id!r}: none of its {found['made']} solutions is accepted ({why}); "
        "change [expert] or [quality], or generate more"
    )


def _table(
    segments: Segments, dataset_id: str, cut: str, solution_index: int, split: str
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
    return pa.table(list(columns.values()), schema=unsealed)


def _vectors(array: np.ndarray, kind: pa.DataType) -> pa.Array:
    """Rows of a matrix as an Arrow column of equal lists, without a detour through Python."""
    values = pa.array(np.ascontiguousarray(array, dtype=np.float32).ravel())
    if pa.types.is_fixed_size_list(kind):
        return pa.FixedSizeListArray.from_arrays(values, type=kind)
    offsets = np.arange(len(array) + 1, dtype=np.int32) * array.shape[1]
    return pa.ListArray.from_arrays(pa.array(offsets), values).cast(kind)
