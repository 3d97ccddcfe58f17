"""A pool of Ray actors: one item each at a time, retried where a worker died.

An actor whose process or host dies is replaced, wherever Ray finds a free core. An item is handed
only to an actor that has answered, so none waits for a process that finds no host. (Ray can restart
actors by itself, but then calls them unavailable for as long as that takes, and tells of each
attempt on standard output.)
"""

import logging
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import ray
from ray.actor import ActorHandle
from ray.exceptions import RayError, RayTaskError

from services.cluster.cluster import Failure, Outcome
from services.cluster.worker import SINGLE_THREADED, Reply, Workplace, described
from services.errors import ClusterError

T = TypeVar("T")
R = TypeVar("R")

RETRIES = 3
"""How often an item is tried again after a worker died over it."""

FAILED_STARTS = 5
"""So many workers in a row that die before they answer mean that none can be started."""

PATIENCE_S = 30.0
"""After so long without any worker, say so."""

logger = logging.getLogger(__name__)


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
        self._size = size
        self._shared: ray.ObjectRef | None = None
        self._actors: list[ActorHandle] = []
        self._failed_starts = 0
        self._starting: dict[ray.ObjectRef, ActorHandle] = {}
        self._idle: list[ActorHandle] = []
        self._running: dict[ray.ObjectRef, tuple[ActorHandle, _Attempt[T]]] = {}
        self._again: deque[_Attempt[T]] = deque()

    def outcomes(self, items: Iterable[T]) -> Generator[Outcome[T, R], None, None]:
        """One outcome for each item; the actors end when the generator does, however it ends."""
        source = map(_Attempt, items)
        try:
            first = next(source, None)
            if first is None:
                return
            self._again.append(first)
            # One copy for all actors, for it may hold a whole data set.
            self._shared = ray.put(self._make_worker)
            for _ in range(self._size):
                self._hire()
            while True:
                yield from self._assign(source)
                if not self._running and not self._again and self._idle:
                    return
                yield from self._settle(self._wait())
        finally:
            for actor in list(self._actors):
                self._dismiss(actor)

    def _hire(self) -> None:
        """Start an actor, which answers when its process is up."""
        actor = (
            ray.remote(_Seat)
            .options(num_cpus=1, runtime_env={"env_vars": SINGLE_THREADED})
            .remote()
        )
        self._actors.append(actor)
        self._starting[actor.ready.remote(self._shared)] = actor

    def _dismiss(self, actor: ActorHandle) -> None:
        """End an actor, dead or alive."""
        self._actors.remove(actor)
        with suppress(RayError, ValueError):
            ray.kill(actor)

    def _assign(self, source: Iterator[_Attempt[T]]) -> Iterator[Outcome[T, R]]:
        """Give each idle actor an item; those that cannot even be sent come back at once."""
        while self._idle:
            attempt = self._again.popleft() if self._again else next(source, None)
            if attempt is None:
                return
            try:
                reference = self._idle[-1].run.remote(attempt.item)
            except Exception as error:
                yield _failed(attempt, f"cannot be sent to a worker: {described(error)}")
                continue
            self._running[reference] = (self._idle.pop(), attempt)

    def _wait(self) -> ray.ObjectRef:
        """The next reference that is done, results before answers."""
        pending = [*self._running, *self._starting]
        while True:
            done, _ = ray.wait(pending, num_returns=1, timeout=PATIENCE_S)
            if done:
                return done[0]
            if not self._running:
                logger.warning("cluster: waiting for a free core on any host")

    def _settle(self, reference: ray.ObjectRef) -> Iterator[Outcome[T, R]]:
        if reference in self._starting:
            self._welcome(reference)
            return
        actor, attempt = self._running.pop(reference)
        try:
            yield self._received(actor, reference, attempt)
        except RayError as error:
            # The actor or its host died, or was killed for its memory.
            self._dismiss(actor)
            self._hire()
            deaths = attempt.deaths + 1
            if deaths <= RETRIES:
                self._again.append(_Attempt(attempt.item, deaths))
            else:
                yield Outcome(
                    attempt.item,
                    error=f"worker died {deaths} times over it, last: {described(error)}",
                    failure=Failure.WORKER_DIED,
                )

    def _received(
        self, actor: ActorHandle, reference: ray.ObjectRef, attempt: _Attempt[T]
    ) -> Outcome[T, R]:
        try:
            outcome: Outcome[T, R] = ray.get(reference).about(attempt.item)
        except RayTaskError as error:
            # The work is done, but what it returned cannot be sent back.
            outcome = _failed(attempt, f"its result cannot be sent back: {described(error.cause)}")
        self._idle.append(actor)
        return outcome

    def _welcome(self, reference: ray.ObjectRef) -> None:
        actor = self._starting.pop(reference)
        try:
            ray.get(reference)
        except RayTaskError as error:
            raise _useless(error.cause) from error
        except RayError as error:
            self._failed_starts += 1
            if self._failed_starts == FAILED_STARTS:
                raise _useless(error) from error
            self._dismiss(actor)
            self._hire()
        else:
            self._failed_starts = 0
            self._idle.append(actor)


def _useless(error: BaseException) -> ClusterError:
    return ClusterError(
        f"cluster: no worker can be started: {described(error)}; check that every host has this "
        "version of LMTR installed, and memory for it"
    )


def _failed(attempt: _Attempt[T], error: str) -> Outcome[T, Any]:
    return Outcome(attempt.item, error=error, failure=Failure.EXCEPTION)
