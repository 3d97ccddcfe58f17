"""A cluster of this process alone, for debugging, small work and tests."""

from collections.abc import Callable, Generator, Iterable, Mapping
from types import TracebackType
from typing import Any, Self, TypeVar

from services.cluster.batches import BatchRunner, Parcel, Waiting
from services.cluster.cluster import Cluster, Outcome
from services.cluster.delivery import Event, Kept, Made, Order
from services.cluster.sweep import Sweep, SweepStoppedError, Trial
from services.cluster.worker import Workplace, attempted

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

    def deliver(self, order: Order[T]) -> Generator[Event, None, None]:
        """See :meth:`Cluster.deliver`; a batch is one item, the sink is in this process too."""
        runner, sink = BatchRunner(order.make_worker), order.make_sink()
        waiting: Waiting[T] = Waiting(order.rhythm)

        def kept() -> Kept:
            items, parcels = waiting.items, waiting.take()
            return Kept(items, sink([parcel.payload for parcel in parcels], order.describe()))

        try:
            for item in order.items:
                if order.stopping():
                    break
                reply, payload = runner.run([item])
                note = reply.notes[0] if reply.notes else None
                if note is None:
                    payload, note = order.failed(item, reply.errors[0][1])
                waiting.add(Parcel(payload, (item,), reply.nbytes, (note,)))
                yield Made([note])
                if waiting.due():
                    yield kept()
        finally:
            # A stop of any kind keeps what is made.
            last = kept() if waiting.items else None
        if last is not None:
            yield last

    def sweep(self, sweep: Sweep[Any, Any, Any]) -> None:
        """See :meth:`Cluster.sweep`; one trial after the other, on whatever GPU torch finds."""
        for trial in sweep.trials:

            def report(metrics: Mapping[str, float], trial: Trial[Any] = trial) -> None:
                if sweep.stopping():
                    raise SweepStoppedError
                sweep.on_report(trial, metrics)

            if sweep.stopping():
                return
            try:
                done = attempted(sweep.trainable, trial.config, sweep.data, report)
            except SweepStoppedError:
                return
            sweep.on_done(trial, done)
