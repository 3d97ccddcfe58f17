"""Where workers' rows end: a writer that appends them to one group of a table."""

import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pyarrow as pa

from services.lake.appender import Appended, Appender, Group
from services.lake.housekeeping import join_files
from services.lake.storage import Storage
from services.lake.tables import Lake

COMPACT_EVERY = 256
"""Commits after which small files are joined, so that a long run does not slow down reading."""


@dataclass(frozen=True)
class Receipt:
    """What a writer says of one commit.

    Attributes:
        appended: Rows that are new, and those that were there.
        seconds: Wall time that it took.
        cpu_s: Processor time of the writer so far.
    """

    appended: Appended
    seconds: float
    cpu_s: float


class TableSink:
    """A writer; one per process, made where the table can be reached.

    Args:
        storage: The lake's place.
        group: The rows that it appends.
        since: Last transaction of the group that is known of, see :class:`Appender`.
    """

    def __init__(self, storage: Storage, group: Group, since: int | None = None) -> None:
        self._lake = Lake(storage)
        self._group = group
        self._appender = Appender(self._lake, group, since)
        self._commits = 0
        self._joining: threading.Thread | None = None

    def __call__(self, tables: Sequence[pa.Table], metadata: Mapping[str, str]) -> Receipt:
        """Append the rows of some tables in one transaction.

        Raises:
            LakeError: They break the schema, or the table cannot be written.
        """
        began = time.monotonic()
        appended = self._appender.append(pa.concat_tables(tables), metadata)
        self._commits += 1
        if self._commits % COMPACT_EVERY == 0:
            self._join_files()
        return Receipt(appended, time.monotonic() - began, time.process_time())

    def _join_files(self) -> None:
        """Join small files beside the commits, which go on: joining a gigabyte takes seconds.

        A writer that is killed meanwhile leaves files that no version names, for
        `lmtr lake vacuum`; in an object store it would leave its lock too, so there commits wait.
        """
        if self._lake.storage.is_remote:
            join_files(self._lake, self._group.table)
            return
        if self._joining is not None and self._joining.is_alive():
            return
        of_its_own = Lake(self._lake.storage)
        work = (of_its_own, self._group.table)
        self._joining = threading.Thread(target=join_files, args=work)
        self._joining.start()
