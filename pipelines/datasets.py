"""Which data set a command means, and what the lake says of it."""

from lmtr.errors import DataError
from pipelines.workspace import Workspace


def resolve(workspace: Workspace, dataset_id: str | None) -> str:
    """The data set asked for, or the newest one where none is named.

    Raises:
        DataError: There is no such data set in this home.
    """
    lake = workspace.lake
    rows = lake.read("datasets", ["dataset_id", "created_at"], order_by="created_at").to_pylist()
    known = [row["dataset_id"] for row in rows]
    if dataset_id is None:
        return str(known[-1])
    if dataset_id not in known:
        raise DataError(
            f"data set {dataset_id!r} is not in this home; choose one of: {', '.join(known)}"
        )
    return dataset_id


def dataset_seed(workspace: Workspace, dataset_id: str) -> int:
    """The seed that a data set was made with."""
    rows = workspace.lake.read("datasets", ["seed"], where=f"dataset_id = '{dataset_id}'")
    return int(rows["seed"][0].as_py())
