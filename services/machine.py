"""What this machine has to give: processors, memory, shared memory, room on its disks.

Inside a container these are the container's, whose limits ``os.cpu_count`` and ``/proc`` ignore.
"""

import os
from contextlib import suppress
from pathlib import Path

from pydantic import BaseModel, ConfigDict

CGROUP = Path("/sys/fs/cgroup")
MEMINFO = Path("/proc/meminfo")
SHARED = Path("/dev/shm")


class Room(BaseModel):
    """Room on a disk.

    Attributes:
        path: The folder that was asked for; it need not be there yet.
        free: Bytes that this user may still write.
        total: Bytes that the disk holds.
        error: Why neither is known; empty if they are.
    """

    model_config = ConfigDict(frozen=True, extra="ignore")

    path: str
    free: int = 0
    total: int = 0
    error: str = ""


def room(folder: Path) -> Room:
    """Room on the disk that a folder lies on, or would lie on."""
    try:
        found = os.statvfs(nearest(folder))
    except OSError as error:
        return Room(path=str(folder), error=error.strerror or str(error))
    return Room(
        path=str(folder),
        free=found.f_bavail * found.f_frsize,
        total=found.f_blocks * found.f_frsize,
    )


def nearest(folder: Path) -> Path:
    """The folder, or the nearest one above it that is there."""
    above = folder.absolute()
    return next(place for place in (above, *above.parents) if place.exists())


def shared_memory() -> Room | None:
    """Room in the memory that processes share; None where it is no file system."""
    return room(SHARED) if SHARED.is_dir() else None


def processors(cgroup: Path = CGROUP) -> float:
    """Processors that this process may use at once, a container's limit included."""
    usable = getattr(os, "sched_getaffinity", None)
    there = float(len(usable(0)) if usable else os.cpu_count() or 1)
    limit = _processor_limit(cgroup)
    return there if limit is None else min(there, limit)


def free_memory(cgroup: Path = CGROUP, meminfo: Path = MEMINFO) -> int | None:
    """Bytes that can be had without swapping, a container's limit included; None if unknown."""
    known = [
        free for free in (_free_of_machine(meminfo), _free_of_container(cgroup)) if free is not None
    ]
    return min(known, default=None)


def _processor_limit(cgroup: Path) -> float | None:
    """Of the container, by version 2 of control groups or by version 1."""
    with suppress(OSError, ValueError):
        quota, period = (cgroup / "cpu.max").read_text().split()
        return None if quota == "max" else int(quota) / int(period)
    with suppress(OSError, ValueError):
        quota_us = int((cgroup / "cpu/cpu.cfs_quota_us").read_text())
        period_us = int((cgroup / "cpu/cpu.cfs_period_us").read_text())
        return quota_us / period_us if quota_us > 0 else None
    return None


def _free_of_machine(meminfo: Path) -> int | None:
    with suppress(OSError, ValueError):
        for line in meminfo.read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    return None


def _free_of_container(cgroup: Path) -> int | None:
    names = (
        ("memory.max", "memory.current", "memory.stat", "inactive_file"),
        (
            "memory/memory.limit_in_bytes",
            "memory/memory.usage_in_bytes",
            "memory/memory.stat",
            "total_inactive_file",
        ),
    )
    for limit, usage, statistics, reclaimable in names:
        with suppress(OSError, ValueError):  # "max" is no number: there is no limit
            used = int((cgroup / usage).read_text())
            for line in (cgroup / statistics).read_text().splitlines():
                # Files that are cached count as used, and give way.
                used -= int(line.split()[1]) if line.split()[0] == reclaimable else 0
            return max(0, int((cgroup / limit).read_text()) - used)
    return None
