"""Which data set a command means, and what the lake says of it."""

import json

from lmtr.errors import DataError
from lmtr.robot.model import RobotModel
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


def robot_of(workspace: Workspace, dataset_id: str) -> RobotModel:
    """The robot that a data set was made for, as its configuration recorded it."""
    rows = workspace.lake.read(
        "datasets", ["configuration"], where=f"dataset_id = '{dataset_id}'"
    ).to_pylist()
    return RobotModel.model_validate(json.loads(rows[0]["configuration"])["dataset"]["robot"])
