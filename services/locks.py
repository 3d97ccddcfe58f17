"""Locks of a home: who of this machine does what in it.

The kernel releases a lock when its holder ends, however it ends, so none is ever left behind.
"""

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO

PATIENCE_S = 0.2
"""How long a lock is tried for: whoever looks if it is held takes it for a moment."""

_PAUSE_S = 0.01


class LockHeldError(Exception):
    """Another process holds the lock.

    Attributes:
        holder: Who.
    """

    def __init__(self, holder: "Holder") -> None:
        super().__init__(str(holder))
        self.holder = holder


@dataclass(frozen=True)
class Holder:
    """Who holds a lock.

    Attributes:
        lock: Its name: what is being done.
        process: Id of the process; empty of a lock that several may share.
    """

    lock: str
    process: str = ""

    def __str__(self) -> str:
        return f"process {self.process}" if self.process else "another process"


@dataclass(frozen=True)
class Locks:
    """The locks in a folder, one file each.

    Attributes:
        folder: Where they lie; made with the first lock.
    """

    folder: Path

    @contextmanager
    def held(self, name: str, *, shared: bool = False) -> Iterator[None]:
        """Hold a lock while the block runs.

        Args:
            name: Name of the lock.
            shared: Whether others may hold it at the same time, in the same way.

        Raises:
            LockHeldError: Another process holds it.
        """
        self.folder.mkdir(exist_ok=True)
        kind = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
        with (self.folder / f"{name}.lock").open("a+", encoding="ascii") as file:
            if not _taken(file, kind):
                raise LockHeldError(_holder(name, file))
            file.truncate(0)
            if not shared:
                file.write(str(os.getpid()))
            file.flush()
            yield

    def holders(self) -> list[Holder]:
        """Who holds which lock at this moment, in the order of their names."""
        found = []
        for path in sorted(self.folder.glob("*.lock")):
            # Some file systems give an exclusive lock to those alone who may write.
            mine = os.access(path, os.W_OK)
            with suppress(FileNotFoundError), path.open("r+" if mine else "r") as file:
                if not _taken(file, fcntl.LOCK_EX if mine else fcntl.LOCK_SH):
                    found.append(_holder(path.stem, file))
        return found


def _taken(file: IO[str], kind: int) -> bool:
    end = time.monotonic() + PATIENCE_S
    while True:
        try:
            fcntl.flock(file, kind | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > end:
                return False
            time.sleep(_PAUSE_S)
        else:
            return True


def _holder(name: str, file: IO[str]) -> Holder:
    file.seek(0)
    return Holder(name, file.read())
