"""Processes of a generation that is under way: which is which, and how one is killed.

The only place that knows what Ray calls them.
"""

import os
import signal
import time
from collections.abc import Iterable
from contextlib import suppress
from enum import StrEnum

import psutil


class Role(StrEnum):
    """What a process does."""

    DRIVER = "driver"
    WORKER = "worker"
    WRITER = "writer"
    RAYLET = "raylet"


TITLES: dict[Role, tuple[str, ...]] = {
    Role.WORKER: ("ray::BatchSeat", "ray::Seat", "ray::_Seat"),
    Role.WRITER: ("ray::Writer", "lmtr-writer"),
    Role.RAYLET: ("/raylet/raylet ",),
}
"""Parts of the command lines that processes show, by their role."""


def family(driver: int) -> list[psutil.Process]:
    """The driver's process and all below it."""
    try:
        root = psutil.Process(driver)
        return [root, *root.children(recursive=True)]
    except psutil.NoSuchProcess:
        return []


def playing(role: Role, driver: int) -> list[psutil.Process]:
    """Living processes of this role under a driver, oldest first."""
    members = family(driver)
    if role is Role.DRIVER:
        return members[:1]
    found = [process for process in members if any(t in _line(process) for t in TITLES[role])]
    return sorted(found, key=lambda process: (process.create_time(), process.pid))


def kill(process: psutil.Process) -> bool:
    """SIGKILL; whether the process was still there."""
    with suppress(psutil.NoSuchProcess):
        if process.status() != psutil.STATUS_ZOMBIE:
            process.kill()  # psutil makes sure that the number is still of the same process
            return True
    return False


def left_over(members: Iterable[psutil.Process], patience_s: float) -> list[str]:
    """Command lines of those that still live after so long."""
    alive = [process for process in members if process.pid != os.getpid()]
    until = time.monotonic() + patience_s
    while (alive := [p for p in alive if _lives(p)]) and time.monotonic() < until:
        time.sleep(0.1)
    return [f"{process.pid} {_line(process)}" for process in alive]


def end_all(members: Iterable[psutil.Process]) -> None:
    """End whatever of them still runs."""
    for process in members:
        with suppress(psutil.NoSuchProcess):
            process.send_signal(signal.SIGKILL)


def _lives(process: psutil.Process) -> bool:
    with suppress(psutil.NoSuchProcess):
        return bool(process.is_running() and process.status() != psutil.STATUS_ZOMBIE)
    return False


def _line(process: psutil.Process) -> str:
    with suppress(psutil.Error):
        return " ".join(process.cmdline())
    return ""
