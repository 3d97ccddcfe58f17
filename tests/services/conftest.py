"""A home, a lake and rows for the tests of the services."""

import subprocess
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from services.lake.digest import sealed
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


@pytest.fixture
def spawn() -> Callable[..., "subprocess.Popen[str]"]:
    """Runs Python source in a process of its own."""

    def start(source: str, *arguments: object) -> "subprocess.Popen[str]":
        return subprocess.Popen(
            [sys.executable, "-c", source, *map(str, arguments)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    return start
