"""What a node of a cluster tells of itself; asked by name, so both must stay where they are."""

import os
import tempfile
from pathlib import Path

from lmtr.expert.shared_library import c_compiler
from pipelines.checkup.report import MachineReport
from pipelines.expert_cache import cache_fault, compiled_sizes
from pipelines.remote.versions import Versions
from services.cache import machine_cache
from services.cluster.ray_cluster import HEALTH
from services.machine import free_memory, processors, room, shared_memory


def told(mark: str) -> str:
    """This machine's report as JSON.

    Args:
        mark: A folder that the head has just made in the home; empty if that is not asked.
    """
    return machine_report(mark).model_dump_json()


def machine_report(mark: str = "") -> MachineReport:
    """What this machine has; see :func:`told`."""
    cache = machine_cache()
    fault = cache_fault(cache)
    return MachineReport(
        versions=Versions.here(),
        processors=processors(),
        memory_free=free_memory(),
        shared=shared_memory(),
        temporary=room(Path(tempfile.gettempdir())),
        cache=room(cache),
        compiler=c_compiler() or "",
        cache_fault=fault,
        compiled=0 if fault else len(compiled_sizes(cache)),
        unset=tuple(name for name in HEALTH if name not in os.environ),
        sees_home=Path(mark).is_dir() if mark else None,
    )
