"""What is to be said of a cluster's nodes, from what they told alone."""

from collections.abc import Callable, Iterator, Sequence

from pipelines.checkup.finding import Finding
from pipelines.checkup.report import MachineReport, NodeReport
from pipelines.remote.versions import Versions
from services.cluster.clock import Offset
from services.machine import Room

GB = 1e9

LOW_BYTES = 1e9
"""Temporary files and caches of LMTR are far below that; Ray's may not be."""

FULL_BYTES = 0.1e9
"""With less, processes fail when they start."""

LOW_MEMORY = 0.5e9
"""About what one solver and its Ray process take."""

LATE_S = 1.0
"""Clocks further apart put commits and log lines into a wrong order."""

WRONG_S = 30.0
"""Clocks further apart may have signatures and certificates refused."""

GUIDE = "docs/clusters-existing.md"

Said = tuple[str, str, bool]
"""State, mend, and whether it is fatal."""


def judged_nodes(
    nodes: Sequence[NodeReport], head: Versions, client: Offset | None
) -> Iterator[Finding]:
    """All that is to be said of them; what is well of all nodes is one line.

    Args:
        nodes: Those that live.
        head: Versions of the ``lmtr`` that jobs run.
        client: How far the head's clock is ahead of this client's; None if unknown.
    """
    heard = [node for node in nodes if node.machine is not None]
    solvers = [node for node in heard if node.offered]
    yield from _answering(nodes)
    yield from _each("versions", heard, lambda node: _versions(node, head), "as on the head")
    yield from _clocks(heard, client)
    yield from _processors(nodes)
    yield from _each("memory", heard, _memory, _least(_free_memory(heard)))
    yield from _each("shared memory", heard, _shared, "holds Ray's store")
    yield from _each("temporary files", heard, _temporary, _least(_free_temporary(heard)))
    yield from _each("C compiler", solvers, _compiler, "there")
    yield from _each("compiled experts", solvers, _cache, "can be kept")
    yield from _each("RAY_… variables", heard, _variables, "lost nodes are noticed soon")
    yield from _each("LMTR_HOME", heard, lambda node: _home(node, head), "no contradiction")


def _each(
    subject: str,
    nodes: Sequence[NodeReport],
    judge: Callable[[NodeReport], Said | None],
    well: str,
) -> Iterator[Finding]:
    """One line for all nodes of which the same is to be said, and one for the rest."""
    alike: dict[Said | None, list[str]] = {}
    for node in nodes:
        alike.setdefault(judge(node), []).append(node.label)
    for said, labels in alike.items():
        state, mend, fatal = (well, "", False) if said is None else said
        yield Finding(subject, f"{_called(labels, len(nodes))}: {state}", mend, fatal)


def _called(labels: Sequence[str], of: int) -> str:
    if len(labels) == of > 1:
        return f"all {of} nodes"
    if len(labels) > 3:
        return f"{len(labels)} of {of} nodes ({', '.join(labels[:3])}, …)"
    return ", ".join(labels)


def _least(free: Sequence[int]) -> str:
    return f"{min(free) / GB:.1f} GB free" if free else "nothing is known of it"


def _free_memory(nodes: Sequence[NodeReport]) -> list[int]:
    return [free for node in nodes if (free := _told(node).memory_free) is not None]


def _free_temporary(nodes: Sequence[NodeReport]) -> list[int]:
    rooms = [_told(node).temporary for node in nodes]
    return [room.free for room in rooms if room is not None and not room.error]


def _told(node: NodeReport) -> MachineReport:
    assert node.machine is not None, "only nodes that answered are judged"
    return node.machine


def _answering(nodes: Sequence[NodeReport]) -> Iterator[Finding]:
    def judge(node: NodeReport) -> Said | None:
        if not node.error:
            return None
        if "ModuleNotFoundError" in node.error or "AttributeError" in node.error:
            return (
                f"has no LMTR, or an older one ({node.error})",
                "run every node from the image of the head, or install its version there",
                True,
            )
        return (
            f"does not say what it has: {node.error}",
            "look at its load and its network (`lmtr status`), or start its Ray anew",
            True,
        )

    yield from _each("nodes", nodes, judge, "answers" if len(nodes) == 1 else "answer")


def _versions(node: NodeReport, head: Versions) -> Said | None:
    its = _told(node).versions
    pairs = (
        ("LMTR", its.lmtr, head.lmtr),
        ("Ray", its.ray, head.ray),
        ("Python", its.python, head.python),
    )
    other = [f"{name} {has} where jobs have {want}" for name, has, want in pairs if has != want]
    if other:
        return (
            ", ".join(other),
            "run every node from one image, or install one version everywhere",
            True,
        )
    if its.code != head.code:
        return (
            f"code {its.code} where jobs have {head.code}",
            "bring all nodes to one commit: rows are noted as made by the jobs' code",
            False,
        )
    return None


def _clocks(nodes: Sequence[NodeReport], client: Offset | None) -> Iterator[Finding]:
    if client is None:
        yield Finding("clocks", "the head does not tell its time", "look at the head's log")
        return
    offsets = {node.label: client + node.offset for node in nodes if node.offset is not None}
    off = {label: offset for label, offset in offsets.items() if offset.surely > LATE_S}
    fatal = any(offset.surely > WRONG_S for offset in off.values())
    middles = [offset.middle for offset in off.values()]
    if off and len(off) == len(offsets) and max(middles) - min(middles) < LATE_S:
        yield Finding(
            "clocks",
            f"{_called(list(off), len(offsets))}: {next(iter(off.values()))} of this client's",
            "let this client and the nodes set their clocks by NTP (timedatectl set-ntp true)",
            fatal,
        )
        return
    for label, offset in off.items():
        yield Finding(
            "clocks",
            f"{label}: {offset} of this client's",
            "let it set its clock by NTP (timedatectl set-ntp true)",
            offset.surely > WRONG_S,
        )
    good = [label for label in offsets if label not in off]
    if good:
        most = max(max(offsets[label].high, -offsets[label].low) for label in good)
        called = _called(good, len(offsets))
        yield Finding("clocks", f"{called}: as this client's, {most:.2f} s apart at most")


def _processors(nodes: Sequence[NodeReport]) -> Iterator[Finding]:
    offered = sum(node.offered for node in nodes)
    if not offered:
        yield Finding(
            "processors",
            "no node offers any to Ray, so no work is ever begun",
            "start workers: ray start --address=HEAD:6379 --num-cpus=N",
            fatal=True,
        )
        return

    def judge(node: NodeReport) -> Said | None:
        there = _told(node).processors
        if node.offered <= there + 0.5:
            return None
        return (
            f"offers {node.offered:g} processors and has {there:g}: solvers share them",
            f"start its Ray with --num-cpus={max(1, int(there))}, or give it more",
            False,
        )

    heard = [node for node in nodes if node.machine is not None]
    yield from _each("processors", heard, judge, f"{offered:g} offered in all")


def _memory(node: NodeReport) -> Said | None:
    free = _told(node).memory_free
    if free is None or free >= LOW_MEMORY:
        return None
    return (
        f"{free / GB:.1f} GB free: processes may be killed for want of it",
        "end what else runs there, give it more, or start its Ray with fewer --num-cpus",
        False,
    )


def _shared(node: NodeReport) -> Said | None:
    shared = _told(node).shared
    if shared is None or shared.total >= node.store:
        return None
    return (
        f"/dev/shm holds {shared.total / GB:.2f} GB, Ray's store {node.store / GB:.2f} GB, so "
        "that it lies on a disk",
        "give the container more (--shm-size), or Ray less (--object-store-memory)",
        False,
    )


def _temporary(node: NodeReport) -> Said | None:
    return room_fault(_told(node).temporary)


def _cache(node: NodeReport) -> Said | None:
    machine = _told(node)
    if machine.cache_fault:
        cause, _, mend = machine.cache_fault.partition("; ")
        return cause, mend or "mend this, or its solvers interpret the expert, much slower", False
    return room_fault(machine.cache)


def _compiler(node: NodeReport) -> Said | None:
    if _told(node).compiler:
        return None
    return "none", "install gcc there: without it the expert takes four times as long", False


def _variables(node: NodeReport) -> Said | None:
    unset = _told(node).unset
    if not unset:
        return None
    return (
        f"{', '.join(unset)} not set: a node that is lost may be missed after more than a minute",
        f"set them before `ray start` on every node ({GUIDE})",
        False,
    )


def _home(node: NodeReport, head: Versions) -> Said | None:
    its = _told(node)
    if its.versions.home != head.home:
        has = its.versions.home or "none"
        return (
            f"{has} where the head has {head.home or 'none'}",
            "set the same LMTR_HOME on every node: a job goes on wherever the head is next",
            False,
        )
    if its.sees_home is False:
        return "does not see the head's home; its work needs none", "", False
    return None


def room_fault(room: Room | None, low: float = LOW_BYTES) -> Said | None:
    """What is to be said of the room in a folder; None where there is enough."""
    if room is None or (not room.error and room.free >= low):
        return None
    if room.error:
        return f"{room.path}: {room.error}", "mend its permissions, or name another folder", False
    state = f"{room.free / GB:.1f} of {room.total / GB:.1f} GB free in {room.path}"
    return state, "make room: work may fail half-way", room.free < FULL_BYTES
