"""A damaged table made usable again: nothing is deleted, and nothing is made up.

What cannot be read goes to ``_quarantine`` inside the table, torn log entries and all after them
too. Rows are then looked for in the files that lie outside the table, and those that their digest
vouches for and that the table lacks are added again. A repair that is killed is finished by the
next one: each step leaves the table no worse, and the rows that are lacking are always asked anew.
"""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa
import pyarrow.fs as pafs
from deltalake import CommitProperties, Transaction, write_deltalake
from deltalake.exceptions import DeltaError

from services.errors import LakeError
from services.lake.examination import Examiner, file_batches
from services.lake.inspection import data_files, inspect_table, table_files
from services.lake.log import FOLDER, read_log
from services.lake.schemas import IDENTITY, MADE_TOGETHER, SCHEMAS
from services.lake.tables import Lake

QUARANTINE = "_quarantine"
APP_ID = "lmtr-repair"


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
        refused: Rows in those files that the table lacks, but that are damaged or were made
            together with one that is.
    """

    table: str
    log_files: list[str] = field(default_factory=list)
    version: int | None = None
    files: dict[str, str] = field(default_factory=dict)
    missing: dict[str, int | None] = field(default_factory=dict)
    taken_out: int = 0
    salvaged: int = 0
    refused: int = 0

    @property
    def changed(self) -> bool:
        """Whether there was anything to do."""
        return bool(self.log_files or self.files or self.missing or self.salvaged)

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
        if lake.exists(table):
            _take_out_damaged(lake, files, done, dry_run)
        if not dry_run:
            _salvage(lake, files, done)
    except (DeltaError, OSError) as error:
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
        lake.delta(done.table).repair(commit_properties=CommitProperties(custom_metadata=notes))


def _salvage(lake: Lake, files: pafs.FileSystem, done: Repair) -> None:
    """Add the rows of files outside the table that it lacks, in one transaction."""
    sources = _sources(files)
    if not sources:
        return
    number = lake.next_number(done.table, APP_ID)
    notes = {"lmtr.repair": f"rows salvaged from {len(sources)} files"}
    properties = CommitProperties(
        app_transactions=[Transaction(APP_ID, number)], custom_metadata=notes
    )
    # Rows go by way of the disk: delta-rs cannot read its own storage while it writes to it.
    with tempfile.TemporaryFile() as spool:
        with pa.ipc.new_stream(spool, SCHEMAS[done.table]) as writer:
            for batch in _lacking(lake, files, sources, done):
                writer.write_batch(batch)
        spool.seek(0)
        if done.salvaged:
            rows = pa.ipc.open_stream(spool)
            write_deltalake(
                lake.open_or_create(done.table), rows, mode="append", commit_properties=properties
            )


def _sources(files: pafs.FileSystem) -> list[str]:
    """Files that may hold rows which the table lost.

    Those in quarantine; and, once entries of the log are there, all that no version refers to: the
    entries that added them may be the ones that are gone. Without that, a file that no version
    refers to is one of a writer that was killed, or is about to commit.
    """
    aside = files.get_file_info(pafs.FileSelector(QUARANTINE, allow_not_found=True, recursive=True))
    names = [info.path for info in aside if info.type == pafs.FileType.File]
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


def _lacking(
    lake: Lake, files: pafs.FileSystem, sources: list[str], done: Repair
) -> Iterator[pa.RecordBatch]:
    """Undamaged rows of files outside the table that it lacks, each once."""
    known = _Known(lake, done.table)
    with Examiner(done.table) as examiner:
        for path in sources:
            spoiled = _spoiled(files, path, done.table, examiner)
            for batch in _readable_part(files, path, done.table):
                new, bad = known.unknown(batch), spoiled.holds(batch, examiner)
                done.refused += int((new & bad).sum())
                wanted = batch.filter(pa.array(new & ~bad))
                wanted = known.take_in(wanted)
                done.salvaged += wanted.num_rows
                yield from wanted.cast(SCHEMAS[done.table]).to_batches()


def _spoiled(files: pafs.FileSystem, path: str, table: str, examiner: Examiner) -> "_Spoiled":
    """The pieces of work in a file whose rows are not all whole."""
    keys = MADE_TOGETHER.get(table, ())
    spoiled = _Spoiled(keys)
    if not keys:
        return spoiled
    try:
        for batch in file_batches(files, path, table):
            spoiled.take_in(batch.filter(pa.array(_bad(batch, examiner))))
    except (pa.ArrowException, OSError):
        spoiled.all = True  # rows of any of them may be in the part that cannot be read
    return spoiled


class _Spoiled:
    """Pieces of work that left more than one row, of which one is damaged.

    A stage does such work again only where none of its rows is there. Were the whole ones kept, the
    others would be missing for good.
    """

    def __init__(self, keys: tuple[str, ...]) -> None:
        self._keys = keys
        self._found: set[tuple[object, ...]] = set()
        self.all = False

    def take_in(self, rows: pa.Table) -> None:
        """Remember whose rows these are."""
        self._found.update(_tuples(rows, self._keys))

    def holds(self, rows: pa.Table, examiner: Examiner) -> np.ndarray:
        """Which rows are damaged, or were made together with one that is."""
        if not self._keys:
            return _bad(rows, examiner)
        return np.array([self.all or each in self._found for each in _tuples(rows, self._keys)])


def _bad(rows: pa.Table, examiner: Examiner) -> np.ndarray:
    """Which rows are damaged."""
    bad = np.zeros(len(rows), dtype=bool)
    for broken in examiner.examine(rows).broken:
        bad[broken.rows] = True
    return bad


def _readable_part(files: pafs.FileSystem, path: str, table: str) -> Iterator[pa.Table]:
    """The batches of a file up to where it is damaged."""
    try:
        yield from file_batches(files, path, table)
    except (pa.ArrowException, OSError):
        return


def _tuples(rows: pa.Table, columns: tuple[str, ...]) -> list[tuple[object, ...]]:
    """Values of some columns, row by row."""
    return list(zip(*(rows[name].to_pylist() for name in columns), strict=True))


class _Known:
    """Identities that are in the table or have been salvaged."""

    def __init__(self, lake: Lake, table: str) -> None:
        self._keys = IDENTITY[table]
        self._seen: set[tuple[object, ...]] = set()
        if lake.exists(table):
            for batch in lake.batches(table, self._keys):
                self._seen.update(self._identities(batch))

    def unknown(self, rows: pa.Table) -> np.ndarray:
        """Which rows are new, each identity once."""
        return np.array([each not in self._seen for each in self._identities(rows)], dtype=bool)

    def take_in(self, rows: pa.Table) -> pa.Table:
        """Remember rows; returns them without repetitions of their own."""
        first = []
        for position, identity in enumerate(self._identities(rows)):
            if identity not in self._seen:
                self._seen.add(identity)
                first.append(position)
        return rows.take(pa.array(first, pa.int64()))

    def _identities(self, rows: pa.Table) -> list[tuple[object, ...]]:
        return _tuples(rows, self._keys)
