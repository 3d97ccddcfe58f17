"""A stream of single items over a crew of Ray actors, each retried where a worker died."""

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import ray
from ray.exceptions import RayError, RayTaskError

from services.cluster.cluster import Failure, Outcome
from services.cluster.crew import Crew
from services.cluster.worker import Reply, Workplace, described

T = TypeVar("T")
R = TypeVar("R")

RETRIES = 3
"""How often an item is tried again after a worker died over it."""

POLL_S = 1.0
"""Longest wait for an answer before the cluster's health is looked at (s)."""


@dataclass(frozen=True)
class _Attempt(Generic[T]):
    """One item on its way, with the number of workers that have died over it."""

    item: T
    deaths: int = 0


class _Seat:
    """The actor: a workplace in a worker process."""

    def __init__(self) -> None:
        self._workplace: Workplace[Any, Any] | None = None

    def ready(self, make_worker: Callable[[], Callable[[Any], Any]]) -> None:
        """Answers once the process is up and has the code of its work."""
        self._workplace = Workplace(make_worker)

    def run(self, item: object) -> Reply[Any]:
        """Work on one item."""
        assert self._workplace is not None, "items come after the answer"
        return self._workplace.run(item)


class ActorPool(Generic[T, R]):
    """``size`` actors that work on one stream of items."""

    def __init__(self, make_worker: Callable[[], Callable[[T], R]], size: int) -> None:
        self._make_worker = make_worker
        self._crew = Crew(_Seat, size)
        self._running: dict[ray.ObjectRef, _Attempt[T]] = {}
        self._again: deque[_Attempt[T]] = deque()

    def outcomes(self, items: Iterable[T]) -> Generator[Outcome[T, R], None, None]:
        """One outcome for each item; the actors end when the generator does, however it ends."""
        source = map(_Attempt, items)
        try:
            first = next(source, None)
            if first is None:
                return
            self._again.append(first)
            self._crew.start(self._make_worker)
            while True:
                yield from self._assign(source)
                if not self._running and not self._again and self._crew.idle:
                    return
                for reference in self._crew.wait((), POLL_S):
                    settled = list(self._settle(reference))
                    # Its worker goes on while the outcome is being kept; items that cannot be had
                    # must not take with them what is done.
                    try:
                        refused = list(self._assign(source))
                    finally:
                        yield from settled
                    yield from refused
        finally:
            self._crew.close()

    def _assign(self, source: Iterator[_Attempt[T]]) -> Iterator[Outcome[T, R]]:
        """Give each idle actor an item; those that cannot even be sent come back at once."""
        while self._crew.idle:
            attempt = self._again.popleft() if self._again else next(source, None)
            if attempt is None:
                return
            try:
                self._running[self._crew.give(attempt.item)] = attempt
            except Exception as error:
                yield _failed(attempt, f"cannot be sent to a worker: {described(error)}")

    def _settle(self, reference: ray.ObjectRef) -> Iterator[Outcome[T, R]]:
        self._crew.settle(reference)
        attempt = self._running.pop(reference, None)
        if attempt is None:  # a worker's first answer
            return
        try:
            yield ray.get(reference).about(attempt.item)
        except RayTaskError as error:
            # The work is done, but what it returned cannot be sent back.
            yield _failed(attempt, f"its result cannot be sent back: {described(error.cause)}")
        except RayError as error:
            # The actor or its host died, or was killed for its memory.
            deaths = attempt.deaths + 1
            if deaths <= RETRIES:
                self._again.append(_Attempt(attempt.item, deaths))
            else:
                yield Outcome(
                    attempt.item,
                    error=f"worker died {deaths} times over it, last: {described(error)}",
                    failure=Failure.WORKER_DIED,
                )


def _failed(attempt: _Attempt[T], error: str) -> Outcome[T, Any]:
    return Outcome(attempt.item, error=error, failure=Failure.EXCEPTION)
