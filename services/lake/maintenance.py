"""What a table takes up, how it came about, and the removal of files that nothing refers to."""

import math
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import pyarrow.fs as pafs

from services.errors import LakeError, LostVersionError
from services.lake.delta import VERSION_KEY
from services.lake.inspection import DataFile, data_files, table_files
from services.lake.log import FOLDER, read_log
from services.lake.sandbox import evaluated
from services.lake.schemas import IDENTITY, SCHEMAS
from services.lake.tables import Lake

GRACE = timedelta(hours=1)
"""Age from which a file that no version refers to is no longer one that is being written."""

PINNED_BY: dict[str, tuple[tuple[str, str], ...]] = {
    "segments": (("models", "segments_version"), ("evaluations", "segments_version"))
}
"""Tables and columns that name versions of a table which must stay readable."""


@dataclass(frozen=True)
class TableInfo:
    """What a table takes up.

    Attributes:
        table: Its name.
        rows: Rows of the present version.
        files: Data files of the present version.
        nbytes: Their bytes.
        stored_bytes: Bytes of everything below the table's folder, older versions and log included.
        version: Present version.
        schema_version: Version of its schema.
        log_entries: Entries of its log.
        by_dataset: Rows of each data set; empty for a table that knows no data sets.
    """

    table: str
    rows: int
    files: int
    nbytes: int
    stored_bytes: int
    version: int
    schema_version: str
    log_entries: int
    by_dataset: dict[str, int]


@dataclass(frozen=True)
class Unneeded:
    """A file that may go.

    Attributes:
        path: Relative to the table.
        nbytes: Its size.
    """

    path: str
    nbytes: int


def info(lake: Lake, table: str) -> TableInfo:
    """What a table takes up.

    Raises:
        LakeError: The table is missing or cannot be read.
    """
    delta = lake.delta(table)
    listed, stored = data_files(delta), _stored(table_files(lake, table))
    _require_files(table, listed, stored)
    entries = [each for each in stored if each.path.startswith(f"{FOLDER}/")]
    return TableInfo(
        table=table,
        rows=lake.dataset(table, delta).count_rows(),
        files=len(listed),
        nbytes=sum(file.size for file in listed),
        stored_bytes=sum(each.size for each in stored),
        version=delta.version(),
        schema_version=delta.metadata().configuration[VERSION_KEY],
        log_entries=sum(each.path.endswith(".json") for each in entries),
        by_dataset=_rows_by_dataset(lake, table),
    )


def history(lake: Lake, table: str, limit: int | None = None) -> list[dict[str, Any]]:
    """The versions of a table, newest first.

    Returns:
        For each: ``version``, ``when``, ``operation``, ``rows`` that it added (None if unsaid),
        ``by`` which program, and ``notes``, what the writer itself noted.
    """
    return [_told(commit) for commit in lake.delta(table).history(limit)]


def orphans(
    lake: Lake, table: str, grace: timedelta = GRACE, now: datetime | None = None
) -> list[Unneeded]:
    """Data files that no version refers to, left by writers that were killed.

    Args:
        lake: The lake.
        table: Name of the table.
        grace: Age that such a file must have, as a writer may be about to commit it.
        now: The present time.

    Raises:
        LakeError: The log is damaged, so that nobody can tell what it refers to.
    """
    files = table_files(lake, table)
    log = read_log(files)
    _require_whole(table, bool(log.faults))
    return _unmentioned(files, log.mentioned, grace, now)


def forgotten(
    lake: Lake, table: str, grace: timedelta = GRACE, now: datetime | None = None
) -> list[Unneeded]:
    """Data files that neither the present version nor one that is pinned refers to.

    See :func:`orphans` for the arguments.

    Raises:
        LakeError: The log is damaged, or a table that pins versions cannot be read.
    """
    files = table_files(lake, table)
    _require_whole(table, bool(read_log(files).faults))
    kept = {file.path for file in data_files(lake.delta(table))}
    for version in pinned_versions(lake, table):
        with suppress(LostVersionError):  # nothing of it can be kept
            kept |= {file.path for file in data_files(lake.delta(table, version))}
    return _unmentioned(files, frozenset(kept), grace, now)


def pinned_versions(lake: Lake, table: str) -> set[int]:
    """Versions of a table that models and evaluations were made from."""
    return {
        version for by, column in PINNED_BY.get(table, ()) for version in lake.values(by, column)
    }


def remove(lake: Lake, table: str, unneeded: list[Unneeded]) -> None:
    """Delete files of a table that are not needed."""
    files = table_files(lake, table)
    for each in unneeded:
        files.delete_file(each.path)


def _require_files(table: str, listed: list[DataFile], stored: list[pafs.FileInfo]) -> None:
    gone = sorted({each.path for each in listed} - {each.path for each in stored})
    if gone:
        raise LakeError(
            f"table {table!r}: {len(gone)} of its {len(listed)} data files are gone, {gone[0]} for "
            "one; look what else is wrong with `lmtr lake check`"
        )


def _require_whole(table: str, faulty: bool) -> None:
    if faulty:
        raise LakeError(
            f"table {table!r}: its log is damaged, so no file can be told to be unneeded; run "
            "`lmtr lake repair` first"
        )


def _unmentioned(
    files: pafs.FileSystem, mentioned: frozenset[str], grace: timedelta, now: datetime | None
) -> list[Unneeded]:
    """Data files that are not mentioned and old enough.

    A file's age is counted from the present or from the newest file of the table, whichever makes
    it younger. A clock that jumped ahead makes every file look old by the clock, but none older
    than the table's own newest file is.
    """
    stored = _stored(files)
    newest = max((each.mtime for each in stored), default=datetime.now(UTC))
    latest = min(now or datetime.now(UTC), newest)
    return [
        Unneeded(each.path, each.size)
        for each in stored
        if "/" not in each.path
        and each.path.endswith(".parquet")
        and each.path not in mentioned
        and latest - each.mtime >= grace
    ]


def _stored(files: pafs.FileSystem) -> list[pafs.FileInfo]:
    found = files.get_file_info(pafs.FileSelector("", recursive=True))
    return sorted(
        (info for info in found if info.type == pafs.FileType.File), key=lambda info: info.path
    )


def _rows_by_dataset(lake: Lake, table: str) -> dict[str, int]:
    if "dataset_id" not in SCHEMAS[table].names or IDENTITY[table] == ("dataset_id",):
        return {}
    sql = f"SELECT dataset_id, count(*) FROM {table} GROUP BY ALL ORDER BY ALL"
    with evaluated(lake.sources(), sql) as relation:
        return dict(relation.fetchall())


_KNOWN = frozenset(
    {
        "timestamp",
        "operation",
        "operationParameters",
        "operationMetrics",
        "engineInfo",
        "clientVersion",
        "version",
        "readVersion",
        "isolationLevel",
        "isBlindAppend",
    }
)


def _told(commit: dict[str, Any]) -> dict[str, Any]:
    stamp = commit.get("timestamp")
    metrics = commit.get("operationMetrics") or {}
    rows = metrics.get("num_added_rows")
    return {
        "version": commit["version"],
        "when": None if stamp is None else datetime.fromtimestamp(stamp / 1e3, UTC),
        "operation": commit.get("operation", ""),
        "rows": None if rows is None or math.isnan(float(rows)) else int(rows),
        "by": commit.get("engineInfo") or commit.get("clientVersion") or "",
        "notes": {key: commit[key] for key in sorted(commit) if key not in _KNOWN},
    }
