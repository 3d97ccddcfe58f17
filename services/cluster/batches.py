"""Batches: how a worker goes through one, how large they are, and when what they made is due."""

import logging
import time
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from services.cluster.delivery import Maker, Note, Payload, Rhythm
from services.cluster.worker import described

T = TypeVar("T")

MOST_LOGS = 20
"""Warnings of a worker that are kept of one batch."""

FIRST_BATCH = 1
LARGEST_BATCH = 1000

SHARE_OF_REST = 0.5
"""A batch is at most this share of what is left for each worker, so that all end together."""


@dataclass(frozen=True)
class BatchReply:
    """What a worker says of a batch; the payload travels beside it.

    Attributes:
        notes: Of the items that something was made of.
        made: Positions of those items in the batch.
        errors: Position and error of the others.
        seconds: Wall time of the batch.
        nbytes: Size of the payload.
        logs: Warnings that the worker logged.
    """

    notes: tuple[Note, ...]
    made: tuple[int, ...]
    errors: tuple[tuple[int, str], ...]
    seconds: float
    nbytes: int
    logs: tuple[str, ...] = ()


class BatchRunner(Generic[T]):
    """Holds one worker and runs batches.

    A worker that cannot be made is no item's fault: what it raises goes to the caller.
    """

    def __init__(self, make_worker: Callable[[], Maker[T]]) -> None:
        self._maker = make_worker()

    def run(self, items: Sequence[T]) -> tuple[BatchReply, Payload]:
        """Work on the items one by one; what throws costs its item alone."""
        began = time.monotonic()
        products: list[Any] = []
        notes: list[Note] = []
        made: list[int] = []
        errors: list[tuple[int, str]] = []
        for position, item in enumerate(items):
            try:
                product, note = self._maker(item)
            except Exception as error:
                errors.append((position, described(error)))
                continue
            products.append(product)
            notes.append(note)
            made.append(position)
        payload, unfit = self._packed(products)
        errors += [(made[place], error) for place, error in unfit.items()]
        fit = [place for place in range(len(products)) if place not in unfit]
        reply = BatchReply(
            notes=tuple(notes[place] for place in fit),
            made=tuple(made[place] for place in fit),
            errors=tuple(errors),
            seconds=time.monotonic() - began,
            nbytes=int(getattr(payload, "nbytes", 0)),
        )
        return reply, payload

    def _packed(self, products: Sequence[Any]) -> tuple[Payload, dict[int, str]]:
        """Products as a payload, and why which of them cannot be in it."""
        try:
            return (self._maker.pack(products) if products else None), {}
        except Exception as error:
            if len(products) == 1:
                return None, {0: described(error)}
        alone = [self._packed([product])[1].get(0) for product in products]
        unfit = {place: error for place, error in enumerate(alone) if error is not None}
        fit = [product for place, product in enumerate(products) if place not in unfit]
        return (self._maker.pack(fit) if fit else None), unfit


class LogCatcher(logging.Handler):
    """Keeps a worker's warnings for the driver, the first ones of a batch."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Take one record."""
        if len(self._lines) < MOST_LOGS:
            self._lines.append(f"{record.name}: {record.getMessage()}")

    def drained(self) -> tuple[str, ...]:
        """What came in since the last call."""
        lines, self._lines = tuple(self._lines), []
        return lines


class Sizer:
    """Sizes of batches, by how long each worker took for its last ones.

    A slow host gets small batches, and towards the end all do, so that none holds up the rest.
    """

    def __init__(self, rhythm: Rhythm, workers: int) -> None:
        self._target = rhythm.batch_seconds
        self._workers = workers
        self._seconds: dict[Hashable, float] = {}

    def learn(self, worker: Hashable, items: int, seconds: float) -> None:
        """Note how long a worker took for a batch."""
        each = seconds / max(items, 1)
        before = self._seconds.get(worker)
        self._seconds[worker] = each if before is None else 0.5 * (before + each)

    def forget(self, worker: Hashable) -> None:
        """A worker is gone."""
        self._seconds.pop(worker, None)

    def expected(self, worker: Hashable, items: int) -> float | None:
        """Time that a worker may take for a batch (s), where it can be told."""
        known = self._seconds.get(worker) or max(self._seconds.values(), default=None)
        return None if known is None else known * items

    def size(self, worker: Hashable, left: int) -> int:
        """Items of the next batch of a worker, with ``left`` items not begun."""
        each = self._seconds.get(worker)
        if each is None:
            return FIRST_BATCH
        by_time = int(self._target / max(each, 1e-6))
        by_rest = int(SHARE_OF_REST * left / self._workers) + 1
        return max(1, min(by_time, by_rest, LARGEST_BATCH))


@dataclass(frozen=True)
class Parcel(Generic[T]):
    """A payload on its way to the writer.

    Attributes:
        payload: What is to be kept, or where it lies.
        items: The items that it was made of.
        nbytes: Its size.
        notes: What the driver was told of the items.
    """

    payload: Any
    items: tuple[T, ...]
    nbytes: int
    notes: tuple[Note, ...] = ()


class Waiting(Generic[T]):
    """Parcels that wait for the next commit."""

    def __init__(self, rhythm: Rhythm) -> None:
        self._rhythm = rhythm
        self._parcels: list[Parcel[T]] = []
        self._since = 0.0
        self.items = 0
        self.nbytes = 0

    def add(self, parcel: Parcel[T]) -> None:
        """Take one parcel."""
        if not self._parcels:
            self._since = time.monotonic()
        self._parcels.append(parcel)
        self.items += len(parcel.items)
        self.nbytes += parcel.nbytes

    def due(self) -> bool:
        """Whether they are many, large or old enough for a commit."""
        if not self._parcels:
            return False
        old = time.monotonic() - self._since >= self._rhythm.commit_seconds
        many = self.items >= self._rhythm.commit_items
        return old or many or self.nbytes >= self._rhythm.commit_bytes

    def take(self) -> list[Parcel[T]]:
        """All of them; none waits any more."""
        parcels, self._parcels = self._parcels, []
        self.items = self.nbytes = 0
        return parcels
