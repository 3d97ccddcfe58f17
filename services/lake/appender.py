"""Appends that put each row into a table once, whoever else appends the same rows.

Rows of one group (a data set, one cut of it) are known by a whole number, their key. An append
compares and then appends: it reads which keys a snapshot of the table has, leaves out rows whose
keys are among them, and commits the rest as the next transaction of the group. delta-rs refuses the
commit if another transaction of the group came in since that snapshot; then it begins anew. So two
drivers, a writer that was killed after its commit and before its answer, and a batch that is sent
twice all end with one row for each key.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import reduce
from operator import and_

import numpy as np
import pyarrow as pa
import pyarrow.dataset as pads
from deltalake import DeltaTable, Transaction
from deltalake.exceptions import CommitFailedError

from services.errors import LakeError
from services.lake.checks import conform
from services.lake.delta import CONFLICT_RETRIES
from services.lake.tables import Lake
from services.objects.faults import plain


@dataclass(frozen=True)
class Group:
    """Which rows of a table belong together.

    Attributes:
        table: Name of the table.
        where: The columns that all rows of the group share, with their values.
        key: Column with the whole number, from zero, that tells the group's rows apart.
        unique: Whether a key has one row; otherwise all rows of a key are appended at once, and
            then none any more.
    """

    table: str
    where: Mapping[str, str]
    key: str
    unique: bool = True

    @property
    def app_id(self) -> str:
        """Name under which the group's transactions are numbered."""
        return "/".join([self.table, *self.where.values()])

    @property
    def condition(self) -> pads.Expression:
        """Arrow condition that the group's rows meet."""
        return reduce(and_, (pads.field(name) == value for name, value in self.where.items()))


@dataclass(frozen=True)
class Prepared:
    """Rows ready to be committed, or none if all of them are in already.

    Attributes:
        delta: The snapshot that they were compared with.
        rows: Those that it lacks.
        number: Transaction of the group that they become.
    """

    delta: DeltaTable
    rows: pa.Table
    number: int


@dataclass(frozen=True)
class Appended:
    """What came of an append.

    Attributes:
        rows: Rows that are new.
        doubled: Rows that were left out because their keys were in.
        joined: Whether somebody else appended to the group since the last look.
        version: Version of the table that holds them.
    """

    rows: int
    doubled: int
    joined: bool
    version: int


class Keys:
    """A set of whole numbers from zero, a byte each however many they are."""

    def __init__(self, keys: np.ndarray | None = None) -> None:
        self._has = np.zeros(0, dtype=bool)
        if keys is not None:
            self.add(keys)

    def add(self, keys: np.ndarray) -> None:
        """Put keys in."""
        if len(keys) == 0:
            return
        needed = int(keys.max()) + 1
        if needed > len(self._has):
            grown = np.zeros(max(needed, 2 * len(self._has)), dtype=bool)
            grown[: len(self._has)] = self._has
            self._has = grown
        self._has[keys] = True

    def has(self, keys: np.ndarray) -> np.ndarray:
        """Whether each key is in."""
        known = np.zeros(len(keys), dtype=bool)
        near = keys < len(self._has)
        known[near] = self._has[keys[near]]
        return known

    def missing(self, keys: Iterable[int]) -> Iterable[int]:
        """Those that are not in, in their order."""
        return (key for key in keys if key >= len(self._has) or not self._has[key])

    @property
    def end(self) -> int:
        """One more than the greatest; zero if there is none."""
        return int(np.flatnonzero(self._has)[-1]) + 1 if self._has.any() else 0

    def __len__(self) -> int:
        return int(self._has.sum())


class Appender:
    """Appends rows of one group to a table of a lake, each key once.

    It remembers which keys are in and looks again only when somebody else has appended.

    Args:
        lake: The lake.
        group: The rows.
        since: Number of the group's last transaction that the caller knows of, from
            :meth:`present`; what came after it is somebody else's.
    """

    def __init__(self, lake: Lake, group: Group, since: int | None = None) -> None:
        self._lake = lake
        self._group = group
        self._delta: DeltaTable | None = None
        self._known = since
        self._seen = -1
        self._keys = Keys()

    def present(self) -> tuple[Keys, int]:
        """The keys that are in the table now, and the number of the group's last transaction.

        Raises:
            LakeError: The table cannot be read.
        """
        if not self._lake.exists(self._group.table):
            return Keys(), 0
        delta = self._lake.delta(self._group.table)
        return _keys(self._lake, delta, self._group), delta.transaction_version(
            self._group.app_id
        ) or 0

    def append(self, rows: pa.Table, metadata: Mapping[str, str] | None = None) -> Appended:
        """Append the rows whose keys are not in yet.

        Args:
            rows: Rows of the group, of the table's schema.
            metadata: What the table's history shall say of it.

        Raises:
            LakeError: The rows break the schema, the table cannot be written, or others are
                quicker again and again.
        """
        checked = conform(self._group.table, rows)
        joined = False
        for _ in range(CONFLICT_RETRIES):
            prepared, with_others = self.prepare(checked)
            joined = joined or with_others
            if self.commit(prepared, metadata):
                new = prepared.rows.num_rows
                version = prepared.delta.version()
                return Appended(new, checked.num_rows - new, joined, version)
            joined = True
        raise LakeError(
            f"table {self._group.table!r}: {CONFLICT_RETRIES} appends in a row lost against other "
            f"writers of {self._group.app_id!r}; stop one of them"
        )

    def prepare(self, rows: pa.Table) -> tuple[Prepared, bool]:
        """Compare rows with the table; also tells whether others have appended since."""
        delta = self._snapshot()
        number = delta.transaction_version(self._group.app_id) or 0
        joined = self._known is not None and number != self._known
        if number != self._seen:
            self._keys = _keys(self._lake, delta, self._group)
        self._known = self._seen = number
        keys = rows[self._group.key].to_numpy()
        new = ~self._keys.has(keys)
        if self._group.unique:
            first = np.zeros(len(keys), dtype=bool)
            first[np.unique(keys, return_index=True)[1]] = True
            new &= first
        return Prepared(delta, rows.filter(pa.array(new)), number + 1), joined

    def commit(self, prepared: Prepared, metadata: Mapping[str, str] | None = None) -> bool:
        """Commit what was prepared; False if others were quicker, and it must be prepared again."""
        if not prepared.rows.num_rows:
            return True
        transaction = Transaction(self._group.app_id, prepared.number)
        try:
            self._lake.commit(
                self._group.table, prepared.delta, prepared.rows, transaction, metadata
            )
        except CommitFailedError:
            self._delta = None
            return False
        except BaseException:
            # Whether it came through is not known: look at the table before anything else.
            self._delta, self._seen = None, -1
            raise
        self._known = self._seen = prepared.number
        self._keys.add(prepared.rows[self._group.key].to_numpy())
        return True

    def _snapshot(self) -> DeltaTable:
        if self._delta is None:
            self._delta = self._lake.open_or_create(self._group.table)
        else:
            self._lake.refresh(self._group.table, self._delta)
        return self._delta


def _keys(lake: Lake, delta: DeltaTable, group: Group) -> Keys:
    """The keys of the group in a snapshot."""
    dataset = lake.dataset(group.table, delta)
    keys = Keys()
    try:
        for batch in dataset.to_batches(columns=[group.key], filter=group.condition):
            keys.add(batch.column(0).to_numpy())
    except (pa.ArrowException, OSError) as error:
        raise LakeError(
            f"table {group.table!r} cannot be read: {plain(error)}; look what is wrong with "
            "`lmtr lake check`"
        ) from error
    return keys
