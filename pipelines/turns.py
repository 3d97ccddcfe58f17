"""Who may change a home at the same time as whom.

Stages append, and many may at once. Care that moves or deletes files has the home for itself: it
and the stages keep each other out. Each takes its own lock first and looks at the others' then, so
that of two that start at the same moment at least one sees the other.

Locks are of one machine: what other machines do in the same home cannot be seen here.
"""

from collections.abc import Iterator
from contextlib import contextmanager

from services.errors import HomeError
from services.home import Home
from services.locks import Holder

REPAIR = "lake-repair"
MIGRATION = "lake-migrate"
COMPACTION = "lake-compact"
VACUUM = "lake-vacuum"
VACUUM_ALONE = "lake-vacuum-alone"

ALONE = (REPAIR, VACUUM_ALONE)
"""Locks of those that have the home for themselves."""

CARE = "lake-"
"""How the names of locks of care begin; those of stages begin with the command's name."""


@contextmanager
def beside_others(home: Home, name: str, *, shared: bool = False) -> Iterator[None]:
    """Change a home while others do, unless one has it for itself.

    Args:
        home: The home.
        name: Name of the lock, ``COMMAND-…``.
        shared: Whether several processes may do the same thing at once.

    Raises:
        HomeError: Another process does the same, or has the home for itself.
    """
    with home.lock(name, shared=shared):
        alone = [holder for holder in home.locks.holders() if holder.lock in ALONE]
        if alone:
            raise _refusal(home, alone, name)
        yield


@contextmanager
def alone(home: Home, name: str) -> Iterator[None]:
    """Change a home while nobody else does.

    Args:
        home: The home.
        name: One of :data:`ALONE`.

    Raises:
        HomeError: Another process changes the home.
    """
    with home.lock(name):
        others = [holder for holder in home.locks.holders() if holder.lock != name]
        if others:
            raise _refusal(home, others, name)
        yield


def at_work(home: Home) -> list[Holder]:
    """Who generates, segments, trains, evaluates or moves files in a home at this moment."""
    holders = home.locks.holders()
    return [each for each in holders if each.lock in ALONE or not each.lock.startswith(CARE)]


def require_no_stage(home: Home, name: str) -> None:
    """Refuse care that stages do not survive.

    Raises:
        HomeError: A stage is at work; the message names it.
    """
    stages = at_work(home)
    if stages:
        raise _refusal(home, stages, name)


def told(holder: Holder) -> str:
    """A holder for people: command, process, and what it is about."""
    about = f", {holder.lock}" if not holder.lock.startswith(CARE) else ""
    return f"`{_command(holder.lock)}` ({holder}{about})"


def _command(lock: str) -> str:
    """The command that takes a lock."""
    words = lock.split("-")
    return f"lmtr {' '.join(words[:2] if lock.startswith(CARE) else words[:1])}"


def _refusal(home: Home, holders: list[Holder], name: str) -> HomeError:
    listed = " and ".join(map(told, holders))
    verb, whose = ("is", "it is") if len(holders) == 1 else ("are", "they are")
    return HomeError(
        f"home {home.name}: {listed} {verb} at work; wait until {whose} done, or stop "
        f"{'it' if len(holders) == 1 else 'them'}, and then run `{_command(name)}` again"
    )
