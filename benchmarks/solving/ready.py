"""The expert as this machine runs it best, and a word if that is not as machine code."""

from pathlib import Path

from rich.console import Console

from lmtr.expert.settings import ExpertSettings
from lmtr.expert.solve import Expert
from lmtr.robot.model import RobotModel
from services.cache import machine_cache


def ready_expert(
    robot: RobotModel, settings: ExpertSettings, cache: Path | None, console: Console
) -> Expert:
    """An expert, compiled where that is possible.

    Args:
        robot: The robot.
        settings: Its settings.
        cache: Folder of compiled problems; none for that of this machine.
        console: Where it is said why an expert runs interpreted, which takes some four times
            longer.
    """
    expert = Expert(robot, settings, machine_cache(cache))
    if not expert.compiled:
        console.print(
            f"the expert runs interpreted, times are no figures of it: "
            f"{expert.build_report.reason}",
            markup=False,
            soft_wrap=True,
        )
    return expert
