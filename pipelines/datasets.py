"""Which data set a command means, and what the lake says of it."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from lmtr.errors import ConfigurationError, DataError
from pipelines.config import Configuration, parse
from pipelines.progress import say
from pipelines.workspace import Workspace
from services.files import is_file_name

DECIDING = ("dataset", "tasks", "expert", "quality")
"""Sections of a configuration that decide the rows of a data set."""

SHOWN_DIFFERENCES = 8


def resolve(workspace: Workspace, dataset_id: str | None, preferred: str | None = None) -> str:
    """The data set asked for, else the preferred one, else the newest.

    Raises:
        DataError: There is no such data set in this home.
    """
    lake = workspace.lake
    rows = lake.read("datasets", ["dataset_id", "created_at"], order_by="created_at").to_pylist()
    known = [row["dataset_id"] for row in rows]
    if not known:
        raise DataError(
            "this home describes no data set; make one with `lmtr generate`, which describes one "
            "that is there again if it is given the same settings"
        )
    wanted = dataset_id or preferred or known[-1]
    if wanted not in known:
        raise DataError(
            f"data set {wanted!r} is not in this home; make it with `lmtr generate`, or choose "
            f"with --dataset one of: {', '.join(known)}"
        )
    if not is_file_name(wanted):  # reports and pictures are called by it
        raise DataError(
            f"data set {wanted!r}: none can be called that; use no home whose tables say so"
        )
    return str(wanted)


def configuration_of(workspace: Workspace, dataset_id: str) -> Configuration:
    """The settings that a data set was made with, as it recorded them."""
    rows = workspace.lake.read(
        "datasets", ["configuration"], where=f"dataset_id = '{dataset_id}'"
    ).to_pylist()
    return parse(json.loads(rows[0]["configuration"]))


def require_same(
    config: Configuration, workspace: Workspace, dataset_id: str | None = None
) -> None:
    """Refuse to put rows of other settings into a data set that is there.

    Args:
        config: The settings that rows would be made with.
        workspace: The home.
        dataset_id: The data set they would go to; the configuration's own by default.

    Raises:
        ConfigurationError: It was made with other settings; the message says which.
    """
    wanted = dataset_id or config.dataset_id
    recorded = _recorded(workspace).get(wanted)
    if recorded is None:
        return
    differing = list(_differences(recorded, _deciding(config)))
    if differing or wanted != config.dataset_id:
        what = _listed(differing) or "the version of LMTR"
        raise ConfigurationError(
            f"data set {wanted!r} was made with other settings: {what}; use those, or leave its "
            "name out and make another data set"
        )


def continued(
    workspace: Workspace, dataset_id: str, settings: Configuration, *, solutions: int | None
) -> Configuration:
    """The settings that a data set was made with, to go on with it.

    Args:
        workspace: The home.
        dataset_id: The data set.
        settings: Where the work runs; what it says of the data set is not looked at.
        solutions: How many solutions it shall have; None for as many as were asked for at first,
            or as many as it has if it was extended.

    Raises:
        ConfigurationError: This version of LMTR would make other rows.
        DataError: There is no such data set.
    """
    recorded = configuration_of(workspace, resolve(workspace, dataset_id))
    count = solutions or max(recorded.dataset.solutions, _end(workspace, dataset_id))
    config = asking(recorded, count).model_copy(update={"cluster": settings.cluster})
    require_same(config, workspace, dataset_id)
    return config


def asking(config: Configuration, solutions: int) -> Configuration:
    """The same data set with so many solutions."""
    section = config.dataset.model_copy(update={"solutions": solutions})
    return config.model_copy(update={"dataset": section})


def _end(workspace: Workspace, dataset_id: str) -> int:
    """One more than the greatest index of a data set's solutions."""
    if not workspace.lake.exists("solutions"):
        return 0
    sql = f"SELECT max(index) + 1 FROM solutions WHERE dataset_id = '{dataset_id}'"
    return int(workspace.lake.query_value(sql) or 0)


def announce(config: Configuration, workspace: Workspace) -> None:
    """Say how a new data set differs from the last one of its name and seed."""
    recorded = _recorded(workspace)
    prefix = config.dataset_id.rpartition("-")[0]
    siblings = [name for name in recorded if name.rpartition("-")[0] == prefix]
    if config.dataset_id in recorded or not siblings:
        return
    differing = list(_differences(recorded[siblings[-1]], _deciding(config)))
    what = _listed(differing) or "the version of LMTR"
    say(f"generate: {config.dataset_id} is new; it differs from {siblings[-1]} in {what}")


def _recorded(workspace: Workspace) -> dict[str, Mapping[str, Any]]:
    """Settings of all data sets by their ids, oldest first."""
    if not workspace.lake.exists("datasets"):
        return {}
    rows = workspace.lake.read(
        "datasets", ["dataset_id", "configuration", "created_at"], order_by="created_at"
    ).to_pylist()
    return {row["dataset_id"]: json.loads(row["configuration"]) for row in rows}


def _deciding(config: Configuration) -> Mapping[str, Any]:
    plain: Mapping[str, Any] = json.loads(config.model_dump_json(include=set(DECIDING)))
    return plain


def _differences(old: object, new: object, path: str = "") -> Iterator[str]:
    """Settings that differ, as ``key: old → new``, but for how many solutions are asked for."""
    if path == "dataset.solutions" or old == new:
        return
    if not (isinstance(old, Mapping) and isinstance(new, Mapping)):
        yield f"{path}: {_short(old)} → {_short(new)}"
        return
    for key in sorted(old.keys() | new.keys()):
        below = f"{path}.{key}" if path else str(key)
        yield from _differences(old.get(key), new.get(key), below)


def _listed(differing: list[str]) -> str:
    more = len(differing) - SHOWN_DIFFERENCES
    return ", ".join(differing[:SHOWN_DIFFERENCES]) + (f" and {more} more" if more > 0 else "")


def _short(value: object) -> str:
    return json.dumps(value) if value is not None else "none"
