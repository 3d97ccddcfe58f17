"""A pool of Ray actors: one item each at a time, retried where a worker died.

Ray restarts an actor whose process or host dies. An item is handed only to an actor that has
answered, so none waits for a process that finds no host.
"""

import logging
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import ray
from ray.actor import ActorHandle
from ray.exceptions import RayActorError, RayError, RayTaskError

from services.cluster.cluster import Failure, Outcome
from services.cluster.worker import SINGLE_THREADED, Workplace, described
from services.errors import ClusterError

T = TypeVar("T")
R = TypeVar("R")

RETRIES = 3
"""How often an item is tried again after a worker died over it."""

PATIENCE_S = 30.0
"""After so long without any worker, say so."""

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class _Attempt(Generic[T]):
    """One item on its way, with the number of workers that have died over it."""

    item: T
    deaths: int = 0


class ActorPool(Generic[T, R]):
    """``size`` actors that work on one stream of items."""

    def __init__(self, make_worker: Callable[[], Callable[[T], R]], size: int) -> None:
        self._make_worker = make_worker
        self._size = size
        self._actors: list[ActorHandle] = []
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
            self._start()
            while True:
                yield from self._assign(source)
                if not self._running and not self._again and self._idle:
                    return
                yield from self._settle(self._wait())
        finally:
            for actor in self._actors:
                with suppress(RayError, ValueError):
                    ray.kill(actor, no_restart=True)

    def _start(self) -> None:
        actor_class = ray.remote(Workplace)
        # Shared by all actors: it may hold a whole data set.
        make_worker = ray.put(self._make_worker)
        for _ in range(self._size):
            actor = actor_class.options(
                num_cpus=1, max_restarts=-1, runtime_env={"env_vars": SINGLE_THREADED}
            ).remote(make_worker)
            self._actors.append(actor)
            self._await(actor)

    def _await(self, actor: ActorHandle) -> None:
        """Ask an actor to answer when its process is up, through any number of restarts."""
        self._starting[actor.ready.options(max_task_retries=-1).remote()] = actor

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
            # The actor or its host died, or was killed for its memory; Ray restarts it.
            self._await(actor)
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
        except RayActorError as error:
            raise ClusterError(
                f"cluster: no worker can be started: {described(error)}; check that every host "
                "has this version of LMTR installed"
            ) from error
        self._idle.append(actor)


def _failed(attempt: _Attempt[T], error: str) -> Outcome[T, Any]:
    return Outcome(attempt.item, error=error, failure=Failure.EXCEPTION)
