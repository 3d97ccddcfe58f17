"""Whether an expert's settings suit a robot: what no task could be solved with is refused early."""

from lmtr.errors import ConfigurationError
from lmtr.expert.settings import ExpertSettings
from lmtr.robot.model import RobotModel


def require_suitable(robot: RobotModel, settings: ExpertSettings) -> None:
    """Refuse settings that suit other robots, but not this one.

    Raises:
        ConfigurationError: The settings ask the robot's base below the ground, or leave its feet
            no room.
    """
    if settings.range_of_motion_margin >= min(robot.range_of_motion):
        raise ConfigurationError(
            f"expert: range_of_motion_margin must be less than the range of motion "
            f"{robot.range_of_motion} m of robot {robot.name!r}, got "
            f"{settings.range_of_motion_margin} m, which leaves its feet no room; lower it"
        )
    if settings.limits.height >= robot.nominal_height:
        raise ConfigurationError(
            f"expert: limits.height must be less than the nominal height {robot.nominal_height} m "
            f"of robot {robot.name!r}, got {settings.limits.height} m, which lets its base sink "
            "into the ground; lower it"
        )
