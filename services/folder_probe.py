"""Does a folder keep two writers apart? Asked of its file system before anything is trusted to it.

A commit to a table is a file that must not be there yet: delta-rs writes it under another name and
links it to its own, which a file system must refuse if there is one. Locks keep two compactions
apart. Network and cluster file systems may lack either, or pretend.
"""

import fcntl
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from services.errors import HomeError
from services.marker import MARKER

PREFIX = f".{MARKER}.probe-"
"""Whoever makes a home at the same time does not take a folder of such a name for foreign."""


@contextmanager
def probed_folder(folder: Path) -> Iterator[Path]:
    """Try in a folder what commits to tables need, and leave an own folder there for the block.

    Args:
        folder: It is there.

    Yields:
        A folder in it, which goes with the block.

    Raises:
        HomeError: It cannot be written to, or does not keep two writers apart.
    """
    try:
        own = tempfile.TemporaryDirectory(prefix=PREFIX, dir=folder, ignore_cleanup_errors=True)
    except OSError as error:
        raise HomeError(
            f"folder {folder} cannot be written to ({error.strerror or error}); mend its "
            "permissions, make room, or name another home"
        ) from error
    with own as name:
        place = Path(name)
        for what, attempt in _ATTEMPTS.items():
            _require(folder, what, attempt, place)
        yield place


def _require(folder: Path, what: str, attempt: Callable[[Path], bool], place: Path) -> None:
    try:
        kept = attempt(place)
    except OSError as error:
        raise HomeError(
            f"folder {folder}: its file system cannot {what} ({error.strerror or error}); put the "
            "home on a local disk, NFS 4, or an object store"
        ) from error
    if not kept:
        raise HomeError(
            f"folder {folder}: its file system does not {what} for one writer alone, so two "
            "writers would overwrite one another's commits; put the home on a local disk, NFS 4, "
            "or an object store"
        )


def _flushes(place: Path) -> bool:
    file = place / "written"
    file.write_bytes(b"?" * 4096)
    for path in (file, place):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    return file.read_bytes() == b"?" * 4096


def _links_once(place: Path) -> bool:
    first, second, commit = place / "first", place / "second", place / "commit"
    first.write_bytes(b"first")
    second.write_bytes(b"second")
    os.link(first, commit)
    with suppress(FileExistsError):
        os.link(second, commit)
        return False
    return commit.read_bytes() == b"first"


def _renames(place: Path) -> bool:
    new, old = place / "new", place / "old"
    old.write_bytes(b"old")
    new.write_bytes(b"new")
    os.replace(new, old)
    return old.read_bytes() == b"new" and not new.exists()


def _locks(place: Path) -> bool:
    with (place / "lock").open("a") as one, (place / "lock").open("a") as other:
        fcntl.flock(one, fcntl.LOCK_EX | fcntl.LOCK_NB)
        with suppress(BlockingIOError):
            fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return False
    return True


_ATTEMPTS: dict[str, Callable[[Path], bool]] = {
    "write and flush files": _flushes,
    "link a file to a new name": _links_once,
    "rename files": _renames,
    "lock files": _locks,
}
