"""One process at a time replaces a table's files.

delta-rs (1.6) lets two compactions replace the same files at once, notices no conflict, and then
has their rows twice. Appends are not concerned: they add files, and a compaction leaves those alone
that came in after it began.
"""

import fcntl
import os
import secrets
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from services.errors import LakeError, StoreError
from services.lake.storage import Storage
from services.objects.store import ObjectStore

LOCK = "_lmtr_rewrite.lock"
"""Name of the lock inside a table's folder; Delta ignores names with an underscore."""


def lock_of(storage: Storage, table: str) -> str:
    """Path or address of a table's lock, for people."""
    return f"{storage.table(table)}/{LOCK}"


def holder_of(storage: Storage, table: str) -> str:
    """Who holds a table's lock in an object store, in words; empty if nobody does."""
    assert storage.access is not None, "on a disk the kernel knows"
    return (ObjectStore(storage.access).get(f"{table}/{LOCK}") or b"").decode().strip()


@contextmanager
def rewriting(storage: Storage, table: str) -> Iterator[bool]:
    """Be the only process that replaces files of a table; gives False if another one is.

    On a disk the kernel releases the lock when its holder ends, however it ends. In an object store
    the lock is an object, which stays behind if its holder is killed and then has to be removed by
    hand: nobody else could tell for sure.

    Raises:
        LakeError: The lock cannot be opened on this disk.
        StoreError: The object store cannot be reached or written to.
    """
    held = _held_in_store(storage, table) if storage.is_remote else _held_on_disk(storage, table)
    with held as alone:
        yield alone


@contextmanager
def _held_on_disk(storage: Storage, table: str) -> Iterator[bool]:
    try:
        file = (storage.folder / table / LOCK).open("a", encoding="ascii")
    except OSError as error:
        raise LakeError(
            f"table {table!r}: its lock cannot be opened ({error.strerror or error}); check space "
            f"and permissions of {lock_of(storage, table)}"
        ) from error
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
            return
        yield True


@contextmanager
def _held_in_store(storage: Storage, table: str) -> Iterator[bool]:
    assert storage.access is not None, "only object stores come here"
    store, key = ObjectStore(storage.access), f"{table}/{LOCK}"
    # The client repeats a request whose answer was lost, and then finds what it wrote itself.
    mine = f"process {os.getpid()} on {socket.gethostname()} ({secrets.token_hex(8)})\n".encode()
    try:
        alone = store.put_new(key, mine) or store.get(key) == mine
    except StoreError:
        with suppress(StoreError):
            if store.get(key) == mine:
                store.delete(key)
        raise
    if not alone:
        yield False
        return
    try:
        yield True
    finally:
        store.delete(key)
