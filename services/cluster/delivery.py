"""A delivery line: items go to workers in batches, what they make goes to one writer.

What travels between worker and writer never passes through the driver, which only learns a few
figures of each item (its note) and, once they are kept, the writer's receipt.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, Protocol, TypeVar

T = TypeVar("T")
T_contra = TypeVar("T_contra", contravariant=True)

Note = Mapping[str, Any]
Receipt = Any
Payload = Any


class Maker(Protocol[T_contra]):
    """What works in a worker process."""

    def __call__(self, item: T_contra, /) -> tuple[Any, Note]:
        """The product of one item, and what the driver shall know of it."""
        ...

    def pack(self, products: Sequence[Any], /) -> Payload:
        """The products of a batch as one thing that travels well."""
        ...


class Sink(Protocol):
    """What keeps the products, in the writer's process."""

    def __call__(self, payloads: Sequence[Payload], metadata: Mapping[str, str], /) -> Receipt:
        """Keep some payloads, all or none; those that are kept already make no difference."""
        ...


@dataclass(frozen=True)
class Rhythm:
    """How large batches and commits are.

    Attributes:
        batch_seconds: Time that a batch of items shall take a worker (s).
        commit_items: So many items are committed together, or more while a commit is under way.
        commit_seconds: What is made is committed at least this often (s).
        uncommitted_bytes: Workers pause while so much waits for the writer.
    """

    batch_seconds: float = 2.0
    commit_items: int = 500
    commit_seconds: float = 10.0
    uncommitted_bytes: int = 64_000_000

    @property
    def commit_bytes(self) -> int:
        """Half of what may wait is committed: workers fill the other half meanwhile."""
        return self.uncommitted_bytes // 2


@dataclass(frozen=True)
class Order(Generic[T]):
    """What is to be made and kept.

    Attributes:
        make_worker: Makes a worker, once in each process; travels by pickle.
        make_sink: Makes the writer's sink; travels by pickle.
        items: What to work on, drawn only as workers are free.
        total: How many they are.
        failed: Makes payload and note of an item that no worker could make anything of, out of
            it and what went wrong.
        rhythm: Sizes of batches and commits.
        describe: What the table's history shall say of the commit that is about to be made.
        stopping: Whether no more items shall be begun.
    """

    make_worker: Callable[[], Maker[T]]
    make_sink: Callable[[], Sink]
    items: Iterable[T]
    total: int
    failed: Callable[[T, str], tuple[Any, Note]]
    rhythm: Rhythm = field(default_factory=Rhythm)
    describe: Callable[[], Mapping[str, str]] = dict
    stopping: Callable[[], bool] = lambda: False


@dataclass(frozen=True)
class Made:
    """Items that workers are done with, by their notes; they are not kept yet."""

    notes: Sequence[Note]


@dataclass(frozen=True)
class Kept:
    """A commit: how many items it holds, and the sink's receipt."""

    items: int
    receipt: Receipt


@dataclass(frozen=True)
class Trouble:
    """What went wrong and was mended, for progress and statistics.

    Attributes:
        kind: One word, such as ``worker_died``.
        items: How many items are done again for it.
        notes: Those of items that were told as made, and are to be made again.
    """

    kind: str
    items: int = 0
    notes: Sequence[Note] = ()


Event = Made | Kept | Trouble
