"""The expert of a configuration, from the cache of the machine that this runs on."""

from pathlib import Path

from lmtr.expert.compilation import BuildReport
from lmtr.expert.solve import Expert
from pipelines.config import Configuration
from pipelines.expert_cache import cache_fault
from services.cache import machine_cache


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
