"""A cluster of this process alone, for debugging, small work and tests."""

from collections.abc import Callable, Generator, Iterable
from types import TracebackType
from typing import Self, TypeVar

from services.cluster.cluster import Cluster, Outcome
from services.cluster.worker import Workplace

T = TypeVar("T")
R = TypeVar("R")


class LocalCluster(Cluster):
    """Works on one item after the other, in order, in this process."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        return

    def stream(
        self,
        make_worker: Callable[[], Callable[[T], R]],
        items: Iterable[T],
        *,
        in_flight: int | None = None,
    ) -> Generator[Outcome[T, R], None, None]:
        """See :meth:`Cluster.stream`; one item is under way at a time."""
        workplace = Workplace(make_worker)
        for item in items:
            yield workplace.run(item).about(item)
