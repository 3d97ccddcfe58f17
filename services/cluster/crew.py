"""Ray actors that work on one thing each at a time, replaced where their process or host dies.

Work is handed only to an actor that has answered, so none waits for a process that finds no host.
(Ray can restart actors by itself, but then calls them unavailable for as long as that takes, and
tells of each attempt on standard output.)
"""

import logging
import time
from collections.abc import Iterable
from contextlib import suppress
from typing import Any

import ray
from ray.actor import ActorHandle
from ray.exceptions import RayError, RayTaskError

from services.cluster.worker import SINGLE_THREADED, described
from services.errors import ClusterError, ClusterLostError

FAILED_STARTS = 5
"""So many workers in a row that do not come to answer mean that none can be started, where none
works; a larger crew must fail as often as it has workers."""

NEXT_START_S = 30.0
"""Pause before a place is filled again after so many failed starts (s)."""

PATIENCE_S = 30.0
"""After so long without any worker, say so."""

LOST_S = 3.0
"""After so long without any work under way, see whether this host still belongs to the cluster."""

logger = logging.getLogger(__name__)


class Crew:
    """``size`` actors of one class, each with the same argument to begin with.

    Attributes:
        idle: Actors that wait for work.
        busy: The reference that each piece of work under way will answer, and its actor.
    """

    def __init__(self, seat: type, size: int) -> None:
        self._seat = seat
        self._size = size
        self._shared: ray.ObjectRef | None = None
        self._actors: list[ActorHandle] = []
        self._failed_starts = 0
        self._since_life = 0
        self._due: list[float] = []
        self._starting: dict[ray.ObjectRef, ActorHandle] = {}
        self._quiet_since = time.monotonic()
        self._told_at = self._quiet_since
        self.idle: list[ActorHandle] = []
        self.busy: dict[ray.ObjectRef, ActorHandle] = {}

    def start(self, shared: object) -> None:
        """Start all actors; ``shared`` is what their ``ready`` gets, kept once for all of them."""
        self._shared = ray.put(shared)
        for _ in range(self._size):
            self._hire()

    def close(self) -> None:
        """End all actors."""
        for actor in list(self._actors):
            self._dismiss(actor)

    def dismiss(self, reference: ray.ObjectRef) -> None:
        """End the actor that works on something nobody waits for any more."""
        self._dismiss(self.busy.pop(reference))

    def give(self, *arguments: object, returns: int = 1) -> Any:  # noqa: ANN401 Ray's references
        """Hand work to an idle actor; returns the reference, or references, of its answer.

        The first reference is the one that :meth:`settle` takes. What cannot be sent raises, and
        the actor stays idle.
        """
        given = self.idle[-1].run.options(num_returns=returns).remote(*arguments)
        first = given if returns == 1 else given[0]
        self.busy[first] = self.idle.pop()
        return given

    def wait(self, others: Iterable[ray.ObjectRef], timeout: float) -> list[ray.ObjectRef]:
        """References that are done, of actors and ``others``; none after ``timeout`` (s).

        Raises:
            ClusterLostError: This host does not belong to a running cluster any more.
        """
        self._hire_due()
        pending = [*self.busy, *self._starting, *others]
        if not pending:
            time.sleep(timeout)
            done = []
        else:
            done, _ = ray.wait(pending, num_returns=1, timeout=timeout)
        if done:
            done, _ = ray.wait(pending, num_returns=len(pending), timeout=0)
        if done or self.busy or self.idle:
            self._quiet_since = self._told_at = time.monotonic()
        else:
            self._mind_the_quiet()
        return list(done)

    def settle(self, reference: ray.ObjectRef) -> ActorHandle | None:
        """An actor's answer has come: it is idle again, or replaced if it died; then None.

        Raises:
            ClusterError: No actor can be started.
        """
        if reference in self._starting:
            self._welcome(reference)
            return None
        actor = self.busy.pop(reference)
        try:
            ray.get(reference)
        except RayTaskError:
            pass  # it lives; what went wrong is for the one who asks for the answer
        except RayError:
            self._dismiss(actor)
            self._hire()
            return None
        self._since_life = 0
        self.idle.append(actor)
        return actor

    def _hire(self) -> None:
        """Start an actor, which answers when its process is up."""
        actor = (
            ray.remote(self._seat)
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

    def _welcome(self, reference: ray.ObjectRef) -> None:
        actor = self._starting.pop(reference)
        try:
            ray.get(reference)
        except RayError as error:
            self._dismiss(actor)
            self._mourn(error.cause if isinstance(error, RayTaskError) else error)
        else:
            self._failed_starts = self._since_life = 0
            self.idle.append(actor)

    def _mourn(self, error: BaseException) -> None:
        """A worker did not come to answer: fill its place at once, or later, or give up.

        A host on which none can start does not end the work of the others, and does not get a new
        process every second either.

        Raises:
            ClusterError: None works, and none has since enough of them did not start.
            ClusterLostError: This host does not belong to a running cluster any more.
        """
        self._failed_starts += 1
        self._since_life += 1
        if self._failed_starts < FAILED_STARTS:
            self._hire()
            return
        none = not (self.idle or self.busy or self._starting)
        if none and self._since_life >= max(FAILED_STARTS, self._size):
            require_membership()
            raise _useless(error) from error
        if self._failed_starts == FAILED_STARTS:
            logger.warning(
                "cluster: %d workers in a row did not start, trying on every %.0f s: %s",
                FAILED_STARTS,
                NEXT_START_S,
                described(error),
            )
        self._due.append(time.monotonic() + NEXT_START_S)

    def _hire_due(self) -> None:
        now = time.monotonic()
        ready = [due for due in self._due if due <= now]
        self._due = [due for due in self._due if due > now]
        for _ in ready:
            self._hire()

    def _mind_the_quiet(self) -> None:
        now = time.monotonic()
        if now - self._quiet_since > LOST_S:
            require_membership()
        if now - self._told_at > PATIENCE_S:
            self._told_at = now
            logger.warning("cluster: waiting for a free core on any host")


def require_membership() -> None:
    """Refuse to go on where this host has left the cluster.

    Raises:
        ClusterLostError: Ray's process on this host is gone, or the host is taken for dead.
    """
    here = ray.get_runtime_context().get_node_id()
    if any(node["Alive"] and node["NodeID"] == here for node in ray.nodes()):
        return
    raise ClusterLostError(
        "cluster: Ray's process on this host is gone; run the same command to go on"
    )


def _useless(error: BaseException) -> ClusterError:
    return ClusterError(
        f"cluster: no worker can be started: {described(error)}; check that every host has this "
        "version of LMTR installed, and memory for it"
    )
