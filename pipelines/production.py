"""Production: whatever a group of a table lacks is made on workers and kept exactly once.

Generation and segmentation both go through here, so that both survive the same faults: rows are
made anew where they are missing in the table, and nowhere else is written down what is done.
"""

import functools
import os
import random
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from pipelines.progress import Bar, bar, say
from pipelines.stopping import Stop, stop_on_signals
from pipelines.workspace import Workspace
from services.cluster.delivery import Event, Kept, Made, Maker, Note, Order, Trouble
from services.errors import ClusterLostError
from services.lake.appender import Appender, Group, Keys
from services.lake.sink import Receipt, TableSink

T = TypeVar("T")

RESTARTS = 3
"""How often in a row, without a commit between, a lost cluster is started or joined again."""


class Tally(Protocol):
    """What a stage counts while it works."""

    def add(self, note: Note) -> int:
        """Count one item; returns how many steps of the progress bar it is."""
        ...

    def trouble(self, trouble: Trouble) -> int:
        """Count what went wrong and was mended; returns how many steps are to be made again."""
        ...

    def kept(self, receipt: Receipt) -> None:
        """Take note of a commit."""
        ...

    def words(self) -> str:
        """All of it in a few words, for the progress bar."""
        ...

    def figures(self) -> Mapping[str, str]:
        """All of it by name, for the table's history."""
        ...


@dataclass(frozen=True)
class Plan(Generic[T]):
    """What a stage makes.

    Attributes:
        title: What the progress bar says.
        group: The rows that are made.
        keys: The keys that the group shall have.
        items: Turns keys that are missing into items, drawn as workers are free.
        make_worker: Makes a worker; travels by pickle.
        failed: Payload and note of an item that no worker could make anything of.
        few: So few keys are made in this process, sooner than workers are started.
        item_keys: How many keys an item stands for.
    """

    title: str
    group: Group
    keys: Iterable[int]
    items: Callable[[Iterator[int]], Iterable[T]]
    make_worker: Callable[[], Maker[T]]
    failed: Callable[[T, str], tuple[object, Note]]
    few: int = 0
    item_keys: int = 1


class Missing:
    """Keys to be made, in their order; drawn from while they become fewer."""

    def __init__(self, keys: Iterable[int]) -> None:
        self._keys = deque(keys)

    def __len__(self) -> int:
        return len(self._keys)

    def __iter__(self) -> Iterator[int]:
        while self._keys:
            yield self._keys.popleft()

    def leave_out(self, present: Keys) -> None:
        """Somebody else makes the same rows: drop theirs, and go on in an order of one's own."""
        rest = list(present.missing(self._keys))
        random.Random(os.urandom(8)).shuffle(rest)
        self._keys = deque(rest)


def produce(workspace: Workspace, plan: Plan[T], tally: Tally) -> bool:
    """Make what is missing; returns whether all is there now, False if the user stopped it.

    Raises:
        ServiceError: The cluster or the table does not work.
    """
    losses, before = 0, -1
    with stop_on_signals() as stop:
        while True:
            present, number = Appender(workspace.lake, plan.group).present()
            missing = Missing(present.missing(plan.keys))
            if not missing:
                return True
            losses = losses + 1 if len(present) == before else 0
            before = len(present)
            sink = functools.partial(TableSink, workspace.lake.storage, plan.group, number)
            try:
                _work(workspace, plan, tally, sink, missing, stop)
            except ClusterLostError:
                if stop():
                    return not lacking(workspace, plan.group, plan.keys)
                if losses == RESTARTS:
                    raise
                say("the cluster was lost; starting it again with what is missing")
                continue
            return not stop() or not lacking(workspace, plan.group, plan.keys)


def lacking(workspace: Workspace, group: Group, keys: Iterable[int]) -> bool:
    """Whether any of the keys is not in the table."""
    present, _ = Appender(workspace.lake, group).present()
    return any(True for _ in present.missing(keys))


def _work(
    workspace: Workspace,
    plan: Plan[T],
    tally: Tally,
    sink: Callable[[], TableSink],
    missing: Missing,
    stop: Stop,
) -> None:
    total, asked = len(missing), sum(1 for _ in plan.keys)
    with (
        workspace.cluster(total, plan.few) as cluster,
        bar(plan.title, asked, asked - total) as progress,
    ):
        stop.listen()  # Ray, when it starts, takes SIGTERM for itself
        order = Order(
            make_worker=plan.make_worker,
            make_sink=sink,
            items=plan.items(iter(missing)),
            total=-(-total // plan.item_keys),
            failed=plan.failed,
            rhythm=workspace.cluster_settings.rhythm,
            describe=tally.figures,
            stopping=stop,
        )
        for event in cluster.deliver(order):
            _heed(event, tally, progress)
            if isinstance(event, Kept) and event.receipt.appended.joined:
                missing.leave_out(Appender(workspace.lake, plan.group).present()[0])


def _heed(event: Event, tally: Tally, progress: Bar) -> None:
    if isinstance(event, Made):
        progress.advance(sum(map(tally.add, event.notes)), tally.words())
    elif isinstance(event, Kept):
        tally.kept(event.receipt)
    else:
        progress.advance(-tally.trouble(event), tally.words())
