"""The expert of a configuration, from the cache of the machine that this runs on."""

import tempfile
from pathlib import Path

from lmtr.errors import CompilationError
from lmtr.expert.compilation import BuildReport
from lmtr.expert.shared_library import require_private
from lmtr.expert.solve import Expert
from pipelines.config import Configuration
from services.cache import VARIABLE, machine_cache


def build_expert(config: Configuration) -> Expert:
    """The expert, compiled unless the cache has it."""
    return Expert(config.dataset.robot, config.expert, machine_cache(config.cluster.cache))


def told(report: BuildReport, cache: Path) -> str:
    """What people should know of how an expert came to be; empty if nothing.

    Args:
        report: How it came to be.
        cache: The folder that it was to be kept in.
    """
    if not report.compiled:
        return f"{report.loss}: {cache_fault(cache) or report.reason}"
    if not report.cached:
        return f"expert compiled in {report.seconds:.0f} s, kept for all later runs"
    return ""


def cache_fault(cache: Path) -> str:
    """Why nothing can be compiled into this cache, and what to do about it; empty if it can."""
    try:
        require_private(cache)
        with tempfile.TemporaryFile(dir=cache) as file:
            file.write(b"?")
    except CompilationError as error:
        return str(error)
    except OSError as error:
        return (
            f"cache {cache} cannot be used ({error.strerror or error}); name a folder of your own "
            f"in {VARIABLE} or cluster.cache, or make room"
        )
    return ""
