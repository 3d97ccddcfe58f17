"""The expert as this machine runs it best, and a word if that is not as machine code."""

from pathlib import Path

from rich.console import Console

from lmtr.expert.settings import ExpertSettings
from lmtr.expert.solve import Expert
from lmtr.robot.model import RobotModel
from pipelines.expert import told
from services.cache import machine_cache


def ready_expert(
    robot: RobotModel, settings: ExpertSettings, cache: Path | None, console: Console
) -> Expert:
    """An expert, compiled where that is possible.

    Args:
        robot: The robot.
        settings: Its settings.
        cache: Folder of compiled problems; none for that of this machine.
        console: Where it is said how the expert came to be, above all why it runs interpreted.
    """
    folder = machine_cache(cache)
    expert = Expert(robot, settings, folder)
    if said := told(expert.build_report, folder):
        console.print(said, markup=False, soft_wrap=True)
    return expert
