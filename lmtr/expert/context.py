"""What every constraint and cost is built from: robot, settings, timing windows and blocks."""

from dataclasses import dataclass

from lmtr.expert.blocks import Blocks
from lmtr.expert.quantities import parameter_blocks, quantity_blocks
from lmtr.expert.settings import ExpertSettings
from lmtr.expert.timing import Windows, windows
from lmtr.robot.model import RobotModel


@dataclass(frozen=True)
class Context:
    """Ingredients of one problem.

    Attributes:
        robot: The robot.
        settings: Scope, limits, weights.
        windows: Where contact changes may lie.
        quantities: Blocks of the quantities q that elements are written in.
        parameters: Blocks of the parameters p.
    """

    robot: RobotModel
    settings: ExpertSettings
    windows: Windows
    quantities: Blocks
    parameters: Blocks

    @classmethod
    def of(cls, robot: RobotModel, settings: ExpertSettings) -> "Context":
        """The ingredients that follow from a robot and settings."""
        return cls(
            robot,
            settings,
            windows(settings),
            quantity_blocks(settings),
            parameter_blocks(settings),
        )
