"""A delivery line on Ray: batches to a crew of actors, what they make to one writer actor.

Exactly-once lies with the sink, which keeps each product once; the line makes sure of at least
once. A batch whose worker died is done again item by item, so that one that kills its workers
stands alone. When nothing is left to begin, idle workers repeat what slow ones still hold, and
the first to finish counts.
"""

import logging
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import Any, Generic, TypeVar

import ray
from ray.actor import ActorHandle
from ray.exceptions import RayError, RayTaskError

from services.cluster.batches import BatchReply, BatchRunner, LogCatcher, Parcel, Sizer, Waiting
from services.cluster.crew import Crew
from services.cluster.delivery import Event, Kept, Made, Order, Trouble
from services.cluster.pool import RETRIES
from services.cluster.worker import described
from services.cluster.worker_log import WorkerLog
from services.cluster.writer import WriterSeat
from services.errors import ClusterLostError

T = TypeVar("T")

POLL_S = 0.5
"""Longest wait for an answer before the clock, the user and the cluster are looked at (s)."""

SLOW_FACTOR = 2.5
SLOW_LEAST_S = 3.0
"""A batch is repeated by an idle worker after so many times its expected duration, and so long."""

DRAIN_S = 60.0
"""So long a line that shall stop waits for the batches under way (s)."""


@dataclass(frozen=True)
class _Task(Generic[T]):
    """One item, by number, and how often nothing came of it."""

    number: int
    item: T
    failures: int = 0


@dataclass
class _Batch(Generic[T]):
    """Tasks under way at one actor, and where what it makes of them will lie."""

    tasks: tuple[_Task[T], ...]
    actor: ActorHandle
    payload: ray.ObjectRef
    began: float
    repeated: bool = False


class BatchSeat:
    """The actor of a worker process."""

    def __init__(self) -> None:
        self._runner: BatchRunner[Any] | None = None
        self._logs = LogCatcher()
        logging.getLogger().addHandler(self._logs)
        logging.captureWarnings(True)

    def ready(self, make_worker: Any) -> None:  # noqa: ANN401 whatever makes a worker
        """Answers once the process is up and has the code of its work."""
        self._runner = BatchRunner(make_worker)

    def run(self, items: tuple[Any, ...]) -> tuple[BatchReply, Any]:
        """Work on a batch: the reply, and apart from it the payload."""
        assert self._runner is not None, "batches come after the answer"
        reply, payload = self._runner.run(items)
        return replace(reply, logs=self._logs.drained()), payload


class RayLine(Generic[T]):
    """Carries one order out on a Ray cluster that this process has joined."""

    def __init__(self, order: Order[T], workers: int, healthy: Callable[[], bool]) -> None:
        self._order = order
        self._healthy = healthy
        self._source = map(_Task, count(), order.items)
        self._begun = 0
        self._exhausted = False
        self._crew = Crew(BatchSeat, workers)
        self._writer = WriterSeat(order.make_sink)
        self._sizer = Sizer(order.rhythm, workers)
        self._log = WorkerLog()
        self._open: dict[int, _Task[T]] = {}
        self._again: deque[_Task[T]] = deque()
        self._running: dict[ray.ObjectRef, _Batch[T]] = {}
        self._waiting: Waiting[_Task[T]] = Waiting(order.rhythm)
        self._stopped_at: float | None = None

    def events(self) -> Generator[Event, None, None]:
        """See :meth:`services.cluster.Cluster.deliver`."""
        try:
            yield from self._run()
        except ClusterLostError:
            yield _lost("cluster_lost", [*self._waiting.take(), *self._writer.parcels])
            raise
        finally:
            self._crew.close()
            self._writer.close()
            self._log.close()

    def _run(self) -> Iterator[Event]:
        self._writer.start()
        self._crew.start(self._order.make_worker)
        while True:
            self._require_health()
            self._heed_stop()
            yield from self._assign()
            if self._waiting.due() or self._winding_up():
                self._writer.send(self._waiting, self._order.describe)
            if self._finished():
                return
            for reference in self._crew.wait(self._writer.pending(), POLL_S):
                yield from self._settle(reference)

    def _require_health(self) -> None:
        if not self._healthy():
            raise ClusterLostError(
                "cluster: Ray's process on this host has ended; run the same command to go on"
            )

    def _heed_stop(self) -> None:
        if self._stopped_at is None and self._order.stopping():
            self._stopped_at = time.monotonic()

    def _assign(self) -> Iterator[Event]:
        """Give idle actors batches, unless the line shall stop or the writer is behind."""
        unkept = self._waiting.nbytes + self._writer.nbytes
        while (
            self._crew.idle
            and self._stopped_at is None
            and unkept < self._order.rhythm.uncommitted_bytes
        ):
            tasks = self._next_tasks()
            if tasks:
                self._begin(tasks)
            elif slow := self._slow():
                yield Trouble("slow_worker", self._repeat(slow))
            else:
                return

    def _next_tasks(self) -> tuple[_Task[T], ...]:
        """The next batch for the actor at hand; single tasks where a worker died over them."""
        while self._again:
            task = self._again.popleft()
            if task.number in self._open:
                return (task,)
        size = self._sizer.size(self._crew.idle[-1], self._order.total - self._begun)
        tasks = tuple(task for _, task in zip(range(size), self._source, strict=False))
        self._begun += len(tasks)
        self._exhausted = len(tasks) < size
        self._open.update((task.number, task) for task in tasks)
        return tasks

    def _begin(self, tasks: tuple[_Task[T], ...]) -> None:
        actor = self._crew.idle[-1]
        items = tuple(task.item for task in tasks)
        reference, payload = self._crew.give(items, returns=2)
        self._running[reference] = _Batch(tasks, actor, payload, time.monotonic())

    def _slow(self) -> _Batch[T] | None:
        """A batch that takes much longer than it should, and nobody repeats yet."""
        now = time.monotonic()
        for batch in self._running.values():
            usual = self._sizer.expected(batch.actor, len(batch.tasks)) or 0.0
            late = now - batch.began > max(SLOW_LEAST_S, SLOW_FACTOR * usual)
            if late and not batch.repeated and any(t.number in self._open for t in batch.tasks):
                return batch
        return None

    def _repeat(self, slow: _Batch[T]) -> int:
        slow.repeated = True
        tasks = tuple(task for task in slow.tasks if task.number in self._open)
        self._begin(tasks)
        return len(tasks)

    def _settle(self, reference: ray.ObjectRef) -> Iterator[Event]:
        if reference in self._writer.pending():
            yield from self._kept(reference)
            return
        self._crew.settle(reference)
        batch = self._running.pop(reference, None)
        if batch is None:  # an actor's first answer
            return
        try:
            reply: BatchReply = ray.get(reference)
        except RayTaskError as error:
            # One item may be to blame, or a store that is full just now.
            why = f"cannot be sent back: {described(error.cause)}"
            yield from self._again_or_fail(batch.tasks, "not_sent_back", why)
        except RayError as error:
            self._sizer.forget(batch.actor)
            yield from self._again_or_fail(batch.tasks, "worker_died", described(error))
        else:
            self._log.tell(reply.logs)
            self._sizer.learn(batch.actor, len(batch.tasks), reply.seconds)
            yield from self._made(batch, reply)

    def _made(self, batch: _Batch[T], reply: BatchReply) -> Iterator[Event]:
        made = [batch.tasks[position] for position in reply.made]
        new = [task for task in made if task.number in self._open]
        if made and len(new) == len(made):
            self._waiting.add(Parcel(batch.payload, tuple(made), reply.nbytes, reply.notes))
            for task in made:
                del self._open[task.number]
            yield Made(reply.notes)
        else:
            # A payload cannot be split, and no commit may hold the same product twice.
            self._again.extend(new)
        for position, error in reply.errors:
            yield from self._fail((batch.tasks[position],), error)

    def _again_or_fail(self, tasks: tuple[_Task[T], ...], kind: str, error: str) -> Iterator[Event]:
        """Nothing came of these tasks: each is tried again alone, a few times."""
        numbers, held = {task.number for task in tasks}, set[int]()
        for batch in self._running.values():
            theirs = {task.number for task in batch.tasks}
            held |= theirs
            if theirs & numbers:
                batch.repeated = False  # its copy is gone, and it may hang for good
        lost = [t for t in tasks if t.number in self._open and t.number not in held]
        yield Trouble(kind, len(lost))
        for task in lost:
            after = _Task(task.number, task.item, task.failures + 1)
            if after.failures <= RETRIES:
                self._again.append(after)
            else:
                what = kind.replace("_", " ")
                said = f"{what} {after.failures} times over it, last: {error}"
                yield from self._fail((task,), said)

    def _fail(self, tasks: tuple[_Task[T], ...], error: str) -> Iterator[Event]:
        for task in tasks:
            if self._open.pop(task.number, None) is None:
                continue
            payload, note = self._order.failed(task.item, error)
            nbytes = int(getattr(payload, "nbytes", 0))
            self._waiting.add(Parcel(ray.put(payload), (task,), nbytes, (note,)))
            yield Made([note])

    def _kept(self, reference: ray.ObjectRef) -> Iterator[Event]:
        """The writer has answered, or died; payloads that were lost with a host are made again."""
        answer = self._writer.settle(reference)
        if answer is None:
            yield Trouble("writer_died")
            return
        for parcel in answer.lost:
            for task in parcel.items:
                self._open[task.number] = task
                self._again.append(task)
            yield _lost("host_lost", [parcel])
        if answer.receipt is not None:
            yield Kept(answer.items, answer.receipt)

    def _winding_up(self) -> bool:
        """Whether nothing more will be made."""
        if self._stopped_at is not None:
            late = time.monotonic() - self._stopped_at > DRAIN_S
            return late or not self._running
        return self._exhausted and not self._open

    def _finished(self) -> bool:
        return self._winding_up() and not self._waiting.items and not self._writer.busy


def _lost(kind: str, parcels: Sequence[Parcel[Any]]) -> Trouble:
    """Products that were made and are not there any more."""
    items = sum(len(parcel.items) for parcel in parcels)
    return Trouble(kind, items, [note for parcel in parcels for note in parcel.notes])
