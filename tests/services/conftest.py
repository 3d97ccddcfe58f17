"""A home, a lake and rows for the tests of the services."""

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from deltalake import write_deltalake

from services.cluster import Cluster
from services.lake.digest import sealed
from services.lake.inspection import data_files
from services.lake.log import entry_path
from services.lake.schemas import SCHEMAS, SEGMENT_SIZE, TASK_SIZE
from services.lake.tables import Lake

WHEN = datetime(2026, 11, 22, 12, 30, tzinfo=UTC)


@pytest.fixture
def lake(tmp_path: Path) -> Lake:
    return Lake(tmp_path / "lake")


def make_datasets(ids: list[str]) -> pa.Table:
    rows = [
        {
            "dataset_id": dataset_id,
            "seed": seed,
            "configuration": "{}",
            "robot": "anymal",
            "layouts": "{}",
            "code_version": "0",
            "created_at": WHEN,
        }
        for seed, dataset_id in enumerate(ids)
    ]
    return pa.Table.from_pylist(rows, schema=SCHEMAS["datasets"])


def make_segments(x: np.ndarray, tau: np.ndarray) -> pa.Table:
    count = len(x)
    rows = {
        "dataset_id": pa.array(["a"] * count),
        "solution_index": pa.array(np.arange(count)),
        "segmentation_id": pa.array(["cut"] * count),
        "epoch_s": pa.array(np.linspace(0.0, 1.0, count)),
        "goal_time_s": pa.array(np.full(count, 3.0)),
        "split": pa.array(["train"] * count),
        "x": _vectors(x, TASK_SIZE),
        "tau": _vectors(tau, SEGMENT_SIZE),
    }
    schema = pa.schema([field for field in SCHEMAS["segments"] if field.name != "digest"])
    return sealed("segments", pa.table(rows, schema=schema))


def _vectors(array: np.ndarray, size: int) -> pa.Array:
    return pa.FixedSizeListArray.from_arrays(pa.array(array.astype(np.float32).ravel()), size)


@pytest.fixture
def datasets() -> Callable[[list[str]], pa.Table]:
    """Rows of table ``datasets`` by their ids."""
    return make_datasets


@pytest.fixture
def segments() -> Callable[[np.ndarray, np.ndarray], pa.Table]:
    """Rows of table ``segments`` by x (n, 35) and τ (n, 264)."""
    return make_segments


def make_solutions(
    indices: list[int], *, stances: int = 3, dataset_id: str = "a", **changes: object
) -> pa.Table:
    """Rows of table ``solutions`` as an expert might have made them, sealed; changes go first."""
    nodes = 4
    rows = []
    for index in indices:
        rng = np.random.default_rng(index)
        draw = {
            "start_pose": 3,
            "start_feet": 8,
            "goal_pose": 3,
            "obstacles": 6,
            "noise_amplitudes": 9,
            "noise_timing": 8 * (stances - 1),
            "base_nodes": 12 * nodes,
            "footholds": 12 * stances,
            "swing_nodes": 20 * (stances - 1),
            "force_nodes": 72 * stances,
            "guess_footholds": 12 * stances,
        }
        rows.append(
            {
                "dataset_id": dataset_id,
                "index": index,
                "status": "converged",
                "message": "Solve_Succeeded",
                "accepted": True,
                "reject_reasons": [],
                "cost": 1.0 + index,
                "expected_cost": 2.0,
                "cost_terms": [("tilt", 0.5), ("height", 0.5 + index)],
                "constraint_violation": [("dynamics", 1e-6)],
                "violations": [("drift", 1e-3), ("swing_shortest", np.inf)],
                "iterations": 40,
                "solve_cpu_s": 0.2,
                "liftoff_swaps": 0,
                "gait_order": [3, 0, 2, 1],
                "saturated": [],
                "n_stances": stances,
                "base_start": 0.0,
                "contact_times": np.sort(rng.random((4, 2 * stances)), axis=1).ravel().tolist(),
                "code_version": "0",
                "config_hash": "0",
                "created_at": WHEN,
                **{name: rng.normal(size=size).tolist() for name, size in draw.items()},
                **changes,
            }
        )
    return sealed("solutions", pa.Table.from_pylist(rows, schema=SCHEMAS["solutions"]))


@pytest.fixture
def solutions() -> Callable[..., pa.Table]:
    """Rows of table ``solutions`` by their indices."""
    return make_solutions


@pytest.fixture
def put() -> Callable[[Lake, str, pa.Table], None]:
    """Appends rows past every check of the lake, as damage would."""

    def write(lake: Lake, table: str, rows: pa.Table) -> None:
        write_deltalake(lake.open_or_create(table), rows, mode="append")

    return write


@pytest.fixture
def full(lake: Lake) -> Lake:
    """A lake with solutions 0 to 11 in three files, versions 1 to 3."""
    for number in (1, 2, 3):
        rows = make_solutions(list(range(4 * number - 4, 4 * number)))
        lake.append("solutions", rows, app_id="x", number=number)
    return lake


class Damage:
    """Real damage to the files of a table of solutions."""

    def __init__(self, lake: Lake) -> None:
        self.folder = lake.storage.folder / "solutions"
        self._lake = lake

    def file_with(self, index: int) -> Path:
        """The data file of the present version that holds a solution."""
        for file in data_files(self._lake.delta("solutions")):
            path = self.folder / file.path
            if index in pq.read_table(path, columns=["index"])["index"].to_pylist():
                return path
        raise AssertionError(index)

    def flip(self, path: Path, column: str) -> None:
        """Invert a byte in a data page of a column."""
        group = pq.ParquetFile(path).metadata.row_group(0)
        chunk = next(
            group.column(k)
            for k in range(group.num_columns)
            if group.column(k).path_in_schema.split(".")[0] == column
        )
        content = bytearray(path.read_bytes())
        content[chunk.data_page_offset + chunk.total_compressed_size * 2 // 3] ^= 0xFF
        path.write_bytes(content)

    def tear(self, version: int, content: bytes) -> None:
        """Leave an entry of the log as a crash might."""
        (self.folder / entry_path(version)).write_bytes(content)


@pytest.fixture
def damage(full: Lake) -> Damage:
    """Damage to the lake ``full``."""
    return Damage(full)


@pytest.fixture(scope="module")
def ray_on_this_machine():
    """A Ray of two cores that clusters of the module's tests share."""
    with Cluster.connect(workers=2) as cluster:
        yield cluster


@pytest.fixture
def two(ray_on_this_machine):
    """A cluster of two workers on that Ray."""
    with Cluster.connect(workers=2) as cluster:
        yield cluster


@pytest.fixture(params=[0, 2])
def cluster(request):
    """The same behaviour in this process and on Ray."""
    if request.param:
        request.getfixturevalue("ray_on_this_machine")
    with Cluster.connect(workers=request.param) as cluster:
        yield cluster
