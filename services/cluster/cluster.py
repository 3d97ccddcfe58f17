"""What every cluster does: a stream of items in, a stream of outcomes back."""

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from enum import StrEnum
from types import TracebackType
from typing import Any, Generic, Self, TypeVar, cast

from services.cluster.delivery import Event, Order
from services.cluster.sweep import Sweep
from services.errors import ClusterError

T = TypeVar("T")
R = TypeVar("R")


class Failure(StrEnum):
    """Why an item has no value."""

    EXCEPTION = "exception"
    """Its work raised an exception."""

    WORKER_DIED = "worker_died"
    """Every worker that tried it died: out of memory, or a crash in compiled code."""


@dataclass(frozen=True)
class Outcome(Generic[T, R]):
    """What came of one item; work that fails is data, like work that succeeds.

    Attributes:
        item: The item.
        result: What the worker returned; None if it failed.
        error: What went wrong, in one line; None if nothing did.
        failure: The kind of what went wrong.
        traceback: Where an exception was raised, for people.
    """

    item: T
    result: R | None = None
    error: str | None = None
    failure: Failure | None = None
    traceback: str = ""

    @property
    def value(self) -> R:
        """What the worker returned.

        Raises:
            ClusterError: The work failed; look at ``error`` first.
        """
        if self.error is not None:
            raise ClusterError(f"item {self.item!r} has no value: {self.error}; check its error")
        return cast(R, self.result)


class Cluster(ABC):
    """Workers that are there inside a ``with`` statement."""

    @staticmethod
    def connect(
        address: str | None = None, workers: int | None = None, log_level: int = logging.ERROR
    ) -> "Cluster":
        """A cluster to be entered with ``with``.

        Args:
            address: ``HOST:PORT`` or ``auto`` of a running Ray cluster, from one of its hosts;
                None starts Ray on this machine and stops it at the end.
            workers: Worker processes; None means one for each core of the cluster, 0 means to
                work in this process, one item after the other.
            log_level: Least level of Ray's own messages that are shown.
        """
        if workers is not None and workers < 0:
            raise ClusterError(f"cluster: workers must be 0 or more, got {workers}; correct it")
        if workers == 0:
            from services.cluster.local import LocalCluster

            return LocalCluster()
        from services.cluster.ray_cluster import RayCluster

        return RayCluster(address, workers, log_level)

    @abstractmethod
    def __enter__(self) -> Self: ...

    @abstractmethod
    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None: ...

    @abstractmethod
    def stream(
        self,
        make_worker: Callable[[], Callable[[T], R]],
        items: Iterable[T],
        *,
        in_flight: int | None = None,
    ) -> Generator[Outcome[T, R], None, None]:
        """Work on items, and yield each one's outcome as it completes, in any order.

        An item is taken from ``items`` only when a worker is free for it. Workers go on while an
        outcome is consumed, for one item each; a consumer that pauses for longer pauses them.
        Every item that was taken comes back as exactly one outcome, unless the generator is
        closed before: then what is under way is given up.

        Args:
            make_worker: Makes a worker, once in each process, so that it may hold what is
                expensive to make. It and the items travel by pickle; the code must be installed
                on every host.
            items: What to work on; may be endless.
            in_flight: Most items under way at once; None means one for each worker.

        Raises:
            ClusterError: Workers cannot be started at all.
        """

    @abstractmethod
    def deliver(self, order: Order[T]) -> Generator[Event, None, None]:
        """Carry out an order: items to workers in batches, what they make to one writer.

        Every item is made, or failed for, at least once, and handed to the sink until that has
        kept it; whatever dies in between is replaced. Workers pause while the writer is behind,
        and idle ones repeat what slow ones hold at the end. When ``order.stopping()`` turns true
        nothing more is begun, and what is under way is still kept. Closing the generator gives up
        what is not kept yet.

        Raises:
            ClusterError: Workers or writer cannot be started, or the cluster is lost.
            ServiceError: Whatever the sink refuses to keep.
        """

    @abstractmethod
    def sweep(self, sweep: Sweep[Any, Any, Any]) -> None:
        """Train all trials side by side, one core each, and tell the sweep's owner as they end.

        A trial that raises fails alone; one whose worker died is begun again a few times. When
        ``sweep.stopping()`` turns true no more are begun and those under way are given up.

        Raises:
            ClusterError: GPUs are asked for and there is none, or the cluster is lost.
        """
