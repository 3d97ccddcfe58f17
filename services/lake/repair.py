"""A damaged table made usable again: nothing is deleted, and nothing is made up.

What cannot be read goes to ``_quarantine`` inside the table, torn log entries and all after them
too. Rows are then looked for in the files that lie outside the table, and those that their digest
vouches for and that the table lacks are added again; rows that are made together and of which some
are lost are made again together. A repair that is killed is finished by the
next one: each step leaves the table no worse, and the rows that are lacking are always asked anew.
"""

from dataclasses import dataclass, field

import duckdb
import pyarrow.fs as pafs
from deltalake import CommitProperties
from deltalake.exceptions import DeltaError

from services.errors import LakeError
from services.lake.delta import LOST, commit_nothing
from services.lake.inspection import data_files, inspect_table, table_files
from services.lake.log import FOLDER, read_log, versions_of
from services.lake.recut import bounds_of, noted, take_out
from services.lake.salvage import Salvaged, salvage
from services.lake.schemas import MADE_TOGETHER
from services.lake.tables import Lake

QUARANTINE = "_quarantine"


@dataclass
class Repair:
    """What was done to a table, or would be.

    Attributes:
        table: Its name.
        log_files: Files of the log that were moved away, relative to the table.
        version: Version that the table fell back to; None if its log was whole, -1 if nothing of it
            was.
        files: Data files that were moved away, and what was wrong with each.
        missing: Data files that were gone, and the rows that the log says they had.
        taken_out: Rows of the files that were moved away, as far as the log says.
        salvaged: Rows that were added again from files outside the table.
        refused: Rows in those files that the table lacks, but that are damaged.
        recut: Rows that were taken out because others that are made together with them are lost.
        lost_until: Versions after ``version`` and up to this one can no longer be named; None if
            all can.
    """

    table: str
    log_files: list[str] = field(default_factory=list)
    version: int | None = None
    files: dict[str, str] = field(default_factory=dict)
    missing: dict[str, int | None] = field(default_factory=dict)
    taken_out: int = 0
    salvaged: int = 0
    refused: int = 0
    recut: int = 0
    lost_until: int | None = None

    @property
    def changed(self) -> bool:
        """Whether there was anything to do."""
        done = (self.log_files, self.files, self.missing, self.salvaged, self.recut)
        return any(done) or self.lost_until is not None

    @property
    def lost(self) -> int:
        """Rows that left the table with a file of it and did not come back."""
        gone = self.taken_out + sum(rows or 0 for rows in self.missing.values())
        return max(0, gone - self.salvaged)


def repair_table(lake: Lake, table: str, *, dry_run: bool = False) -> Repair:
    """Make a table usable; nobody else may write to it meanwhile.

    Args:
        lake: The lake.
        table: Name of a table whose folder is there.
        dry_run: Only say what would be done. After a torn log entry the data files cannot be
            judged before the log is mended, and are not.

    Raises:
        LakeError: The table cannot be written, or somebody else repairs it at once.
    """
    done, files = Repair(table), table_files(lake, table)
    log = read_log(files)
    done.log_files = log.unusable()
    if any(path.endswith(".json") for path in done.log_files):
        done.version = log.whole_until
    if dry_run and done.log_files:
        return done
    try:
        for path in done.log_files:
            _set_aside(files, path)
        if not dry_run:
            _pass_over(lake, files, done)
        if lake.exists(table):
            _take_out_damaged(lake, files, done, dry_run)
        if not dry_run:
            _bring_back(lake, files, done)
            if lake.exists(table):
                lake.settle(table, lake.delta(table))
    except (DeltaError, duckdb.Error, OSError) as error:
        raise LakeError(
            f"table {table!r} cannot be repaired: {' '.join(str(error).split())}; check space and "
            f"permissions of {lake.uri(table)}, stop other writers, and run the repair again"
        ) from error
    return done


def _set_aside(files: pafs.FileSystem, path: str) -> None:
    """Move a file to the quarantine, beside others of its name."""
    number, target = 0, f"{QUARANTINE}/{path}"
    while files.get_file_info(target).type != pafs.FileType.NotFound:
        number += 1
        target = f"{QUARANTINE}/{number}/{path}"
    files.move(path, target)


def _take_out_damaged(lake: Lake, files: pafs.FileSystem, done: Repair, dry_run: bool) -> None:
    found = inspect_table(lake, done.table)
    done.files, done.missing = found.damaged, found.missing
    rows = {file.path: file.rows for file in data_files(lake.delta(done.table))}
    done.taken_out = sum(rows[path] or 0 for path in done.files)
    if dry_run:
        return
    for path in done.files:
        _set_aside(files, path)
    if done.files or done.missing:
        notes = {"lmtr.repair": f"files set aside: {len(done.files)}, gone: {len(done.missing)}"}
        delta = lake.delta(done.table)
        if done.table in MADE_TOGETHER:
            notes |= noted(bounds_of(delta, done.table, {*done.files, *done.missing}))
        delta.repair(commit_properties=CommitProperties(custom_metadata=notes))


def _bring_back(lake: Lake, files: pafs.FileSystem, done: Repair) -> None:
    """Salvage rows; of those that are made together, take out what may be half of them instead."""
    if done.table not in MADE_TOGETHER:
        found = salvage(lake, done.table, sources) if (sources := _sources(files)) else Salvaged()
        done.salvaged, done.refused = found.rows, found.refused
    elif lake.exists(done.table):
        done.recut = take_out(lake, done.table)


def _pass_over(lake: Lake, files: pafs.FileSystem, done: Repair) -> None:
    """Let no other rows come under the numbers of versions that went to quarantine.

    Each number is taken by a commit that holds nothing and says so; one more is made on top, so
    that the present version is one that may be named.
    """
    highest = max(versions_of(_quarantined(files)), default=-1)
    if highest < 0:
        return
    delta = lake.open_or_create(done.table, {LOST: QUARANTINE})
    while delta.version() <= highest:
        lost = delta.version() < highest
        commit_nothing(delta, {LOST: QUARANTINE} if lost else {"lmtr.repair": "log mended"})
        lake.refresh(done.table, delta)
        done.lost_until = highest


def _quarantined(files: pafs.FileSystem) -> list[str]:
    aside = files.get_file_info(pafs.FileSelector(QUARANTINE, allow_not_found=True, recursive=True))
    return [info.path for info in aside if info.type == pafs.FileType.File]


def _sources(files: pafs.FileSystem) -> list[str]:
    """Files that may hold rows which the table lost.

    Those in quarantine; and, once entries of the log are there, all that no version refers to: the
    entries that added them may be the ones that are gone. Without that, a file that no version
    refers to is one of a writer that was killed, or is about to commit.
    """
    names = _quarantined(files)
    sources = [name for name in names if name.endswith(".parquet") and FOLDER not in name]
    if any(name.endswith(".json") for name in names):
        mentioned = read_log(files).mentioned
        outside = files.get_file_info(pafs.FileSelector(""))
        sources += [
            info.path
            for info in outside
            if info.path.endswith(".parquet") and info.path not in mentioned
        ]
    return sorted(sources)
