"""The look over a table: its log, its files, and every row in them.

Whatever is wrong is a finding with a name; nothing that is wrong stops the look at the rest.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

import duckdb
import pyarrow as pa
import pyarrow.dataset as pads
import pyarrow.fs as pafs
from deltalake import DeltaTable

from services.errors import LakeError
from services.lake.examination import (
    Examiner,
    file_batches,
    named,
    read_schema,
    row_names,
)
from services.lake.log import read_log
from services.lake.schemas import IDENTITY, MADE_BY, SCHEMAS
from services.lake.tables import Lake
from services.objects.faults import plain

SHOWN = 10
"""Rows that are named of all that break the same thing."""

REPAIR = "run `lmtr lake repair`"

BROKEN_ROWS = 'no repair changes such rows; see "Rows that break a rule" in docs/lake.md'


@dataclass
class Finding:
    """One thing that is wrong, and how many times.

    Attributes:
        table: Table concerned.
        kind: ``log``, ``table``, ``file``, ``identity``, ``null``, ``finite``, ``length``,
            ``range``, ``digest``; pipelines add kinds of their own.
        says: What must hold.
        mend: What to do about it.
        count: How many rows, files or entries break it.
        subjects: The first of them.
    """

    table: str
    kind: str
    says: str
    mend: str
    count: int = 0
    subjects: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class DataFile:
    """A file of the table's present version, as the log has it.

    Attributes:
        path: Relative to the table.
        size: Bytes.
        rows: Rows, if the log says.
    """

    path: str
    size: int
    rows: int | None


@dataclass
class Inspection:
    """What the look at a table came to.

    Attributes:
        table: Its name.
        findings: What is wrong.
        rows: Rows that could be read.
        undigested: Rows made before digests were.
        damaged: Files that cannot be read or hold a row that its digest belies, and why.
        missing: Files that are not there.
        readable: Files that can be read.
        opened: Whether the table could be opened.
    """

    table: str
    findings: list[Finding] = field(default_factory=list)
    rows: int = 0
    undigested: int = 0
    damaged: dict[str, str] = field(default_factory=dict)
    missing: dict[str, int | None] = field(default_factory=dict)
    readable: list[str] = field(default_factory=list)
    opened: bool = False

    @property
    def is_known(self) -> bool:
        """Whether its rows are known, at least in part; of an empty table, that it has none."""
        return bool(self.readable) or (self.opened and not self.damaged and not self.missing)

    def add(
        self, kind: str, says: str, mend: str, subjects: Iterable[str], count: int, most: int
    ) -> None:
        """Count more of the same, and name them while fewer than ``most`` are named."""
        for finding in self.findings:
            if (finding.kind, finding.says) == (kind, says):
                break
        else:
            finding = Finding(self.table, kind, says, mend)
            self.findings.append(finding)
        finding.count += count
        room = most - len(finding.subjects)
        finding.subjects.extend(list(subjects)[: max(0, room)])


def table_files(lake: Lake, table: str) -> pafs.FileSystem:
    """The files of a table, on whatever storage; paths are relative to the table."""
    return lake.files(table)


def tables_found(lake: Lake) -> list[str]:
    """Names of the tables of which anything is there, be it readable or not."""
    return [name for name in SCHEMAS if lake.exists(name) or _holds_files(lake, name)]


def data_files(delta: DeltaTable) -> list[DataFile]:
    """The files of the version that is open, in the order of their names."""
    actions = pa.table(delta.get_add_actions(flatten=True))
    columns = (actions[name].to_pylist() for name in ("path", "size_bytes", "num_records"))
    return sorted(
        (DataFile(path, size, rows) for path, size, rows in zip(*columns, strict=True)),
        key=lambda each: each.path,
    )


def readable_rows(lake: Lake, inspection: Inspection) -> pads.Dataset:
    """The rows of all files that can be read; none of a table that is not there."""
    table = inspection.table
    if not inspection.readable:
        return pads.dataset(read_schema(table).empty_table())
    return pads.dataset(
        inspection.readable,
        schema=read_schema(table),
        format="parquet",
        filesystem=lake.scanned_files(table),
    )


def inspect_table(
    lake: Lake,
    table: str,
    most: int = SHOWN,
    advance: Callable[[int], None] = lambda rows: None,
) -> Inspection:
    """Look at everything that a table holds.

    Args:
        lake: The lake.
        table: Name of a table whose folder is there.
        most: Rows that are named of all that break the same thing.
        advance: Called with the number of rows that were looked at.
    """
    found, files = Inspection(table), table_files(lake, table)
    for fault in read_log(files).faults:
        subject = f"{fault.path} {fault.says}"
        found.add("log", "every file of the log is whole", REPAIR, [subject], 1, most)
    try:
        listed = data_files(lake.delta(table))
    except LakeError as error:
        _add_unopened(found, error, most)
        return found
    found.opened = True
    with Examiner(table) as examiner:
        for file in listed:
            _inspect_file(files, file, examiner, found, most, advance)
    if found.readable:
        for says, keys, count in _doubled(lake, found, most):
            mend = f"{BROKEN_ROWS}; rows of {table} are added by `{MADE_BY[table]}` alone"
            found.add("identity", says, mend, keys, count, most)
    return found


def _add_unopened(found: Inspection, error: LakeError, most: int) -> None:
    """Say why a table cannot be opened; of a damaged log that is said already."""
    says, cause = "it can be opened", error.__cause__
    if found.findings:
        found.add("table", says, REPAIR, ["not before its log is mended"], 1, most)
    elif cause is not None:
        found.add("table", says, REPAIR, [plain(cause)], 1, most)
    else:  # its schema is of another version, and the error says what to do
        reason, _, mend = str(error).rpartition("; ")
        found.add("table", says, mend, [reason], 1, most)


def _holds_files(lake: Lake, table: str) -> bool:
    if not lake.storage.is_remote and not (lake.storage.folder / table).is_dir():
        return False
    found = table_files(lake, table).get_file_info(pafs.FileSelector("", allow_not_found=True))
    return any(not info.path.startswith(".") for info in found)


def _inspect_file(
    files: pafs.FileSystem,
    file: DataFile,
    examiner: Examiner,
    found: Inspection,
    most: int,
    advance: Callable[[int], None],
) -> None:
    info = files.get_file_info(file.path)
    if info.type == pafs.FileType.NotFound:
        found.missing[file.path] = file.rows
        found.add("file", "every data file is there", REPAIR, [file.path], 1, most)
        return
    fault = f"has {info.size} bytes, not {file.size}" if info.size != file.size else ""
    rows = 0
    try:
        for batch in file_batches(files, file.path, found.table):
            rows += batch.num_rows
            belied = _inspect_rows(batch, examiner, found, most)
            fault = fault or ("holds rows that their digests belie" if belied else "")
            advance(batch.num_rows)
        if file.rows is not None and rows != file.rows:
            fault = fault or f"has {rows} rows, not {file.rows}"
        found.readable.append(file.path)
    except (pa.ArrowException, OSError) as error:
        fault = f"cannot be read: {' '.join(str(error).split())[:200]}"
    found.rows += rows
    if fault:
        found.damaged[file.path] = fault
        found.add("file", "every data file is whole", REPAIR, [f"{file.path} {fault}"], 1, most)


def _inspect_rows(batch: pa.Table, examiner: Examiner, found: Inspection, most: int) -> bool:
    """Add what is wrong with a batch; returns whether a digest is."""
    examined = examiner.examine(batch)
    found.undigested += len(examined.undigested)
    for broken in examined.broken:
        subjects = row_names(found.table, batch, broken.rows[:most])
        mend = REPAIR if broken.kind == "digest" else BROKEN_ROWS
        found.add(broken.kind, broken.says, mend, subjects, len(broken.rows), most)
    return any(broken.kind == "digest" for broken in examined.broken)


def _doubled(lake: Lake, found: Inspection, most: int) -> Iterator[tuple[str, list[str], int]]:
    """Identities that more than one row has: what to say, the first of them, how many."""
    keys = IDENTITY[found.table]
    listed = ", ".join(f'"{key}"' for key in keys)
    with duckdb.connect(":memory:") as connection:
        connection.register("kept", readable_rows(lake, found))
        connection.execute(
            f"CREATE TABLE doubled AS SELECT {listed}, count(*) AS n FROM kept "
            f"GROUP BY {listed} HAVING n > 1"
        )
        ((count,),) = connection.execute("SELECT count(*) FROM doubled").fetchall()
        first = connection.execute(f"SELECT * FROM doubled ORDER BY {listed} LIMIT {most}")
        rows = first.fetchall()
    if count:
        names = [
            f"{named(dict(zip(keys, row[:-1], strict=True)))} ({row[-1]} times)" for row in rows
        ]
        yield "no two rows are the same one", names, count
