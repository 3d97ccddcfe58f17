"""A question to every node of the cluster that this process has joined, each in a short time."""

import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import ray
from ray.exceptions import GetTimeoutError, RayError, RayTaskError
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from services.cluster.clock import Offset
from services.cluster.worker import described

HEAD_RESOURCE = "node:__internal_head__"
"""What Ray marks the head's node with."""

CLOCK_S = 2.0
"""A node that has just answered tells its clock within this (s), or is not asked again."""

EXCHANGES = 3
"""The quickest of so many tells most about a clock."""


@dataclass(frozen=True)
class Place:
    """A node that Ray takes for alive.

    Attributes:
        node_id: Ray's id of it.
        name: Its name.
        address: Its address.
        resources: What it offers, by name.
    """

    node_id: str
    name: str
    address: str
    resources: Mapping[str, float]

    @property
    def is_head(self) -> bool:
        """Whether the head runs on it."""
        return HEAD_RESOURCE in self.resources


@dataclass(frozen=True)
class Reply:
    """What a node said.

    Attributes:
        place: The node.
        answer: To the question; empty if none came.
        error: Why none came.
        offset: Of its clock from this process's.
    """

    place: Place
    answer: str = ""
    error: str = ""
    offset: Offset | None = None


def places() -> list[Place]:
    """The nodes that live, the head first."""
    found = [
        Place(
            each["NodeID"], each["NodeManagerHostname"], each["NodeManagerAddress"],
            each["Resources"],
        )
        for each in ray.nodes()
        if each["Alive"]
    ]  # fmt: skip
    return sorted(found, key=lambda place: (not place.is_head, place.address, place.node_id))


def ask_everywhere(
    module: str, function: str, argument: str, within_s: float, asked: Sequence[Place] | None = None
) -> list[Reply]:
    """Call a function on every node, whatever else is under way there.

    It is named and not sent, so that a node which lacks it, or has another one, can still answer.

    Args:
        module: Where it is, on the node.
        function: Its name; takes a text and returns one.
        argument: What it is given.
        within_s: How long all of them may take (s), the start of a process on each included.
        asked: The nodes; by default all that live.
    """
    everywhere = places() if asked is None else asked
    actors = {place.node_id: _enquirer(place) for place in everywhere}
    looks = {
        place.node_id: actors[place.node_id].look.remote(module, function, argument)
        for place in everywhere
    }
    try:
        if looks:
            ray.wait(list(looks.values()), num_returns=len(looks), timeout=within_s)
        return [
            _reply(place, actors[place.node_id], looks[place.node_id], within_s)
            for place in everywhere
        ]
    finally:
        for actor in actors.values():
            with suppress(RayError, ValueError):
                ray.kill(actor)


def _reply(place: Place, actor: Any, look: ray.ObjectRef, within_s: float) -> Reply:  # noqa: ANN401
    try:
        answer = str(ray.get(look, timeout=0))
    except GetTimeoutError:
        return Reply(place, error=f"no answer within {within_s:.0f} s")
    except RayTaskError as error:
        return Reply(place, error=described(error.cause))
    except RayError as error:
        return Reply(place, error=described(error))
    return Reply(place, answer, offset=_offset(actor))


def _offset(actor: Any) -> Offset | None:  # noqa: ANN401 - Ray's handles have no types
    found: Offset | None = None
    for _ in range(EXCHANGES):
        sent = time.time()
        try:
            there = float(ray.get(actor.clock.remote(), timeout=CLOCK_S))
        except RayError:
            return found
        exchange = Offset.told(sent, there, time.time())
        found = exchange if found is None else found.narrowed(exchange)
    return found


def _enquirer(place: Place) -> Any:  # noqa: ANN401 - Ray's handles have no types
    """An actor on that very node, which takes nothing from what runs there."""

    class Enquirer:
        """Defined in a function, so that it travels whole and is looked for on no disk."""

        def look(self, module: str, function: str, argument: str) -> str:
            import importlib

            return str(getattr(importlib.import_module(module), function)(argument))

        def clock(self) -> float:
            import time

            return time.time()

    here = NodeAffinitySchedulingStrategy(place.node_id, soft=False)
    return ray.remote(Enquirer).options(num_cpus=0, scheduling_strategy=here).remote()
