"""The writer of a delivery line: one actor beside the driver, replaced if it dies."""

import logging
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import ray
from ray.actor import ActorHandle
from ray.exceptions import RayError, RayTaskError
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from services.cluster.batches import LogCatcher, Parcel, Waiting
from services.cluster.delivery import Receipt, Sink
from services.cluster.worker import SINGLE_THREADED, described
from services.errors import ClusterError, ServiceError

DEATHS = 5
"""So many writers in a row that die without a commit mean that none can work."""

FETCH_S = 120.0
"""So long the writer waits for a payload from another host (s)."""

logger = logging.getLogger("writer")


class Writer:
    """The actor: a sink in a process of its own."""

    def __init__(self) -> None:
        self._sink: Sink | None = None
        self._logs = LogCatcher()
        logging.getLogger().addHandler(self._logs)
        logging.captureWarnings(True)

    def commit(
        self,
        make_sink: Callable[[], Sink],
        payloads: Sequence[ray.ObjectRef],
        metadata: Mapping[str, str],
    ) -> tuple[Receipt | None, list[int], tuple[str, ...]]:
        """Keep payloads.

        Returns:
            The receipt, positions of payloads that are nowhere any more, and warnings that were
            logged.
        """
        if self._sink is None:
            self._sink = make_sink()
        found, lost = [], []
        for position, reference in enumerate(payloads):
            try:
                found.append(ray.get(reference, timeout=FETCH_S))
            except RayTaskError:
                raise
            except RayError:
                lost.append(position)
        receipt = self._sink(found, metadata) if found else None
        return receipt, lost, self._logs.drained()


@dataclass(frozen=True)
class Answer:
    """What came of a commit.

    Attributes:
        receipt: The sink's; none if all payloads were lost.
        items: How many items it holds.
        lost: Parcels whose payloads were lost with their hosts.
    """

    receipt: Receipt | None
    items: int
    lost: list[Parcel[Any]]


class WriterSeat:
    """The writer as the driver sees it: one commit at a time, sent again if the writer dies.

    Attributes:
        parcels: Those of the commit under way.
    """

    def __init__(self, make_sink: Callable[[], Sink]) -> None:
        self._make_sink = make_sink
        self._actor: ActorHandle | None = None
        self.parcels: list[Parcel[Any]] = []
        self._metadata: Mapping[str, str] = {}
        self._reference: ray.ObjectRef | None = None
        self._deaths = 0

    @property
    def busy(self) -> bool:
        """Whether a commit is under way."""
        return self._reference is not None

    @property
    def nbytes(self) -> int:
        """Bytes under way."""
        return sum(parcel.nbytes for parcel in self.parcels)

    def pending(self) -> tuple[ray.ObjectRef, ...]:
        """Reference of the commit under way."""
        return () if self._reference is None else (self._reference,)

    def start(self) -> None:
        """Start the actor on this host, where the home is."""
        here = NodeAffinitySchedulingStrategy(ray.get_runtime_context().get_node_id(), soft=False)
        self._actor = (
            ray.remote(Writer)
            .options(
                num_cpus=0,
                scheduling_strategy=here,
                runtime_env={"env_vars": SINGLE_THREADED},
            )
            .remote()
        )

    def close(self) -> None:
        """End the actor."""
        if self._actor is not None:
            with suppress(RayError, ValueError):
                ray.kill(self._actor)
            self._actor = None

    def send(self, waiting: Waiting[Any], describe: Callable[[], Mapping[str, str]]) -> None:
        """Begin a commit of all that waits, unless one is under way or nothing waits."""
        if self.busy or not waiting.items:
            return
        self.parcels, self._metadata = waiting.take(), describe()
        self._send()

    def settle(self, reference: ray.ObjectRef) -> Answer | None:
        """What came of the commit under way; None if the writer died and it is sent again.

        Raises:
            ServiceError: The sink cannot keep it.
            ClusterError: No writer can work.
        """
        try:
            receipt, lost, logs = ray.get(reference)
        except RayTaskError as error:
            if isinstance(error.cause, ServiceError):
                raise error.cause from error
            raise ClusterError(
                f"cluster: the writer failed: {described(error.cause)}; mend that and run the same "
                "command to go on"
            ) from error
        except RayError as error:
            self._deaths += 1
            if self._deaths >= DEATHS:
                raise ClusterError(
                    f"cluster: the writer died {DEATHS} times in a row, last: {described(error)}; "
                    "look at this host's memory, and run the same command to go on"
                ) from error
            self.close()
            self.start()
            self._send()
            return None
        for line in logs:
            logger.warning("the writer says: %s", line)
        parcels, self.parcels, self._reference, self._deaths = self.parcels, [], None, 0
        gone = [parcels[position] for position in lost]
        items = sum(len(parcel.items) for parcel in parcels)
        return Answer(receipt, items - sum(len(parcel.items) for parcel in gone), gone)

    def _send(self) -> None:
        assert self._actor is not None, "commits come after the start"
        payloads = [parcel.payload for parcel in self.parcels]
        self._reference = self._actor.commit.remote(self._make_sink, payloads, self._metadata)
