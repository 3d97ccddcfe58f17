"""Which data set a command means, and what the lake says of it."""

import json

from lmtr.errors import DataError
from pipelines.config import Configuration, parse
from pipelines.workspace import Workspace


def resolve(workspace: Workspace, dataset_id: str | None, preferred: str | None = None) -> str:
    """The data set asked for, else the preferred one, else the newest.

    Raises:
        DataError: There is no such data set in this home.
    """
    lake = workspace.lake
    rows = lake.read("datasets", ["dataset_id", "created_at"], order_by="created_at").to_pylist()
    known = [row["dataset_id"] for row in rows]
    wanted = dataset_id or preferred or known[-1]
    if wanted not in known:
        raise DataError(
            f"data set {wanted!r} is not in this home; make it with `lmtr generate`, or choose "
            f"with --dataset one of: {', '.join(known)}"
        )
    return str(wanted)


def configuration_of(workspace: Workspace, dataset_id: str) -> Configuration:
    """The settings that a data set was made with, as it recorded them."""
    rows = workspace.lake.read(
        "datasets", ["configuration"], where=f"dataset_id = '{dataset_id}'"
    ).to_pylist()
    return parse(json.loads(rows[0]["configuration"]))
