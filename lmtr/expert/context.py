"""What every constraint and cost is built from: robot, settings, timing windows and layouts."""

from dataclasses import dataclass

from lmtr.expert.layout import Layout
from lmtr.expert.quantities import parameter_layout, quantity_layout
from lmtr.expert.settings import ExpertSettings
from lmtr.expert.timing import Windows, windows
from lmtr.robot.model import RobotModel
from lmtr.trajectory.trajectory import BASE_STEP


@dataclass(frozen=True)
class Context:
    """Ingredients of one problem.

    Attributes:
        robot: The robot.
        settings: Scope, limits, weights.
        windows: Where contact changes may lie.
        quantities: Layout of the quantities q that elements are written in.
        parameters: Layout of the parameters p.
    """

    robot: RobotModel
    settings: ExpertSettings
    windows: Windows
    quantities: Layout
    parameters: Layout

    @classmethod
    def of(cls, robot: RobotModel, settings: ExpertSettings) -> "Context":
        """The ingredients that follow from a robot and settings."""
        return cls(
            robot,
            settings,
            windows(settings),
            quantity_layout(settings),
            parameter_layout(settings),
        )

    @property
    def samples_per_knot(self) -> int:
        """Samples of the range of motion from one base node to the next."""
        return round(BASE_STEP / self.settings.range_of_motion_step)
