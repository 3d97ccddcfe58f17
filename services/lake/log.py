"""The log of a table as it lies on the storage, read without delta-rs.

delta-rs refuses a table with a torn entry, and skips an empty one without a word, and with it the
rows that it had added. Here every file of the log is looked at by itself.
"""

import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any
from urllib.parse import unquote

import pyarrow as pa
import pyarrow.fs as pafs
import pyarrow.parquet as pq

FOLDER = "_delta_log"
HINT = f"{FOLDER}/_last_checkpoint"

_ENTRY = re.compile(r"(\d{20})\.json")
_CHECKPOINT = re.compile(r"(\d{20})\.checkpoint\.parquet")


@dataclass(frozen=True)
class LogFault:
    """Something wrong with the log.

    Attributes:
        path: File concerned, relative to the table.
        says: What is wrong with it.
    """

    path: str
    says: str


@dataclass(frozen=True)
class TableLog:
    """What the log's files say.

    Attributes:
        entries: What is wrong with the entry of each version; empty for whole ones.
        checkpoints: The same for checkpoints.
        hint: What is wrong with the file that names the newest checkpoint; empty if nothing.
        mentioned: Data files that any version refers to, relative to the table.
    """

    entries: dict[int, str]
    checkpoints: dict[int, str]
    hint: str
    mentioned: frozenset[str]

    @property
    def base(self) -> int:
        """The newest whole checkpoint; -1 if there is none."""
        return max((v for v, fault in self.checkpoints.items() if not fault), default=-1)

    @property
    def whole_until(self) -> int:
        """The newest version up to which nothing is torn or missing; -1 if there is none."""
        version = self.base
        while self.entries.get(version + 1) == "":
            version += 1
        return version

    def reaches(self, version: int) -> bool:
        """Whether whole entries lead to a version, from a whole checkpoint or the first entry."""
        while self.checkpoints.get(version) != "":
            if self.entries.get(version) != "":
                return version < 0
            version -= 1
        return True

    @property
    def faults(self) -> list[LogFault]:
        """Everything wrong, in the order of versions."""
        torn = [LogFault(entry_path(v), says) for v, says in sorted(self.entries.items()) if says]
        broken = [
            LogFault(checkpoint_path(v), says)
            for v, says in sorted(self.checkpoints.items())
            if says
        ]
        hint = [LogFault(HINT, self.hint)] if self.hint else []
        return [*torn, *self._gaps(), *broken, *hint]

    def unusable(self) -> list[str]:
        """Files that must go so that the table is readable again, in the order to move them.

        Newest entries go first: the oldest torn one stays until the last, so that a repair that
        is killed finds the same thing to do again.
        """
        last = self.whole_until
        after = [v for v in self.entries if v > last]
        torn = [v for v, fault in self.entries.items() if fault and v <= last]
        broken = [v for v, fault in self.checkpoints.items() if fault]
        return [
            *([HINT] if self.hint else []),
            *map(checkpoint_path, sorted(broken, reverse=True)),
            *map(entry_path, sorted([*after, *torn], reverse=True)),
        ]

    def _gaps(self) -> Iterator[LogFault]:
        for version in range(self.base + 1, max(self.entries, default=-1)):
            if version not in self.entries:
                yield LogFault(entry_path(version), "is missing, with later ones there")


def entry_path(version: int) -> str:
    """Path of the entry of a version, relative to the table."""
    return f"{FOLDER}/{version:020d}.json"


def checkpoint_path(version: int) -> str:
    """Path of the checkpoint at a version, relative to the table."""
    return f"{FOLDER}/{version:020d}.checkpoint.parquet"


def versions_of(paths: Iterable[str]) -> list[int]:
    """The versions whose entries are among files, whatever folder they were moved to."""
    names = (path.rpartition(f"{FOLDER}/")[2] for path in paths if f"{FOLDER}/" in path)
    return [int(found[1]) for name in names if (found := _ENTRY.fullmatch(name))]


def read_log(files: pafs.FileSystem) -> TableLog:
    """Look at every file of the log of the table at the root of ``files``."""
    entries: dict[int, str] = {}
    checkpoints: dict[int, str] = {}
    mentioned: set[str] = set()
    names = _names(files)
    for name in names:
        if found := _ENTRY.fullmatch(name):
            entries[int(found[1])], paths = _read_entry(files, f"{FOLDER}/{name}")
        elif found := _CHECKPOINT.fullmatch(name):
            checkpoints[int(found[1])], paths = _read_checkpoint(files, f"{FOLDER}/{name}")
        else:
            continue
        mentioned |= paths
    hint = _hint_fault(files, checkpoints) if "_last_checkpoint" in names else ""
    return TableLog(entries, checkpoints, hint, frozenset(mentioned))


def _names(files: pafs.FileSystem) -> list[str]:
    found = files.get_file_info(pafs.FileSelector(FOLDER, allow_not_found=True))
    return sorted(info.base_name for info in found if info.type == pafs.FileType.File)


def _read_entry(files: pafs.FileSystem, path: str) -> tuple[str, set[str]]:
    """What is wrong with an entry, and the data files that it adds or removes."""
    with files.open_input_file(path) as file:
        content = file.read()
    if not content.strip():
        return "is empty", set()
    paths: set[str] = set()
    for number, line in enumerate(content.splitlines(), start=1):
        try:
            action: Any = json.loads(line)
            for kind in ("add", "remove"):
                if kind in action:
                    paths.add(unquote(action[kind]["path"]))
        except (ValueError, TypeError, KeyError):
            return f"is torn in line {number}", paths
    return "", paths


def _read_checkpoint(files: pafs.FileSystem, path: str) -> tuple[str, set[str]]:
    try:
        rows = pq.read_table(path, filesystem=files)
        paths = {
            unquote(text)
            for kind in ("add", "remove")
            if kind in rows.column_names
            for text in _paths(rows[kind])
        }
    except (pa.ArrowException, OSError) as error:
        return f"cannot be read: {' '.join(str(error).split())}", set()
    return "", paths


def _paths(actions: pa.ChunkedArray) -> list[str]:
    paths = actions.combine_chunks().field("path")
    return [path for path in paths.to_pylist() if path is not None]


def _hint_fault(files: pafs.FileSystem, checkpoints: dict[int, str]) -> str:
    """delta-rs opens no table whose hint names a checkpoint that is not there."""
    try:
        with files.open_input_file(HINT) as file:
            version = int(json.loads(file.read())["version"])
    except (ValueError, TypeError, KeyError):
        return "is torn"
    if checkpoints.get(version) != "":
        return f"names a checkpoint at version {version}, which is not there or damaged"
    return ""
