"""Versions of a table brought to the disk for good.

delta-rs leaves what it writes to the kernel, which may take half a minute: after a power cut a
commit that was confirmed could be missing, or there with its files empty. So files are flushed
before a commit is confirmed, other writers' earlier entries included: delta-rs opens no table with
a torn entry, however whole the later ones are.
"""

import json
import os
from contextlib import suppress
from pathlib import Path
from urllib.parse import unquote

from services.lake.log import FOLDER, HINT, checkpoint_path, entry_path

RECENT = 32
"""So many versions before its first are flushed by a process: those that writers at the same time
may not have confirmed yet. Older ones are long on the disk."""


def make_durable(table: Path, version: int, since: int | None = None) -> None:
    """Flush the files of a table's latest versions, and the folders that name them.

    Args:
        table: The table's folder.
        version: Its present version.
        since: Version up to which that has been done; None if nothing is known.

    Raises:
        OSError: A file cannot be flushed, or is not there.
    """
    # A repair may have taken the log back to before what was flushed.
    first = max(version - RECENT, 0) if since is None or since >= version else since + 1
    for number in range(first, version + 1):
        _flush_version(table, number)
    _flush(table / FOLDER)
    _flush(table)
    if since is None:  # the folders themselves may be new
        _flush(table.parent)
        _flush(table.parent.parent)


def _flush_version(table: Path, version: int) -> None:
    """Flush data files, entry and checkpoint of a version, as far as they are there.

    Entries before a checkpoint may be gone, and so may files that were joined or deleted since.
    """
    entry, checkpoint = table / entry_path(version), table / checkpoint_path(version)
    if entry.exists():
        for path in _added(entry):
            _flush_if_there(path)
        _flush(entry)
    # A checkpoint is there before its hint, and a repair may have set either aside.
    _flush_if_there(checkpoint)
    _flush_if_there(table / HINT)


def _added(entry: Path) -> list[Path]:
    """The data files that an entry adds."""
    actions = map(json.loads, entry.read_text(encoding="utf-8").splitlines())
    added = [action["add"]["path"] for action in actions if "add" in action]
    return [entry.parent.parent / unquote(path) for path in added]


def _flush_if_there(path: Path) -> None:
    with suppress(FileNotFoundError):
        _flush(path)


def _flush(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
