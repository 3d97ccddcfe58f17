"""What is wrong with a solution, and by how much, in figures that need no knowledge of the NLP."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.quality.jumping import in_flight, landings, support, vertical_energy_swing
from lmtr.quality.kinematics import (
    closest_footholds,
    height_errors,
    phase_durations,
    range_of_motion_overshoot,
    stance_slip,
)
from lmtr.quality.residual import (
    RigidMotion,
    angular_residual,
    linear_residual,
    open_loop_drift,
    rigid_motion,
)
from lmtr.robot.model import RobotModel
from lmtr.trajectory.sample import FootSamples, sample_feet
from lmtr.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class Violations:
    """Dense violations and extremes of one solution.

    SI units; forces in weights of the robot (1 is m·g), so that thresholds suit any robot.

    Attributes:
        linear_residual_peak: Largest acceleration that the forces leave unexplained (m/s²).
        linear_residual_rms: Its root mean square over time (m/s²).
        angular_residual_peak: Largest angular acceleration left unexplained (rad/s²).
        angular_residual_rms: Its root mean square over time (rad/s²).
        drift: Median distance to the plan after 0.8 s of its forces without feedback (m).
        stance_overshoot: Furthest that a stance foot leaves its range of motion (m).
        swing_overshoot: Likewise a swing foot, which may come as much nearer to the base as it is
            lifted (m).
        friction_excess: Largest excess of a horizontal force component over μ times the normal
            force (weights).
        pull: Largest force of a foot that pulls at the ground (weights).
        contact_change_force: Largest force with which a stance begins or ends next to a swing,
            where it ought to vanish (weights).
        force_peak: Largest force of one foot (weights).
        stance_slip: Longest way that a foot moves while it stands (m).
        stance_height: Largest distance of a standing foot to the ground (m).
        swing_depth: Deepest that a swing foot goes below the ground (m).
        fewest_feet_down: Fewest feet that stand at any one time.
        flight_time: Time without any foot on the ground, or with feet that bear less than a tenth
            of the weight together (s).
        support_least: Least vertical force of all feet together (weights).
        sparse_support_time: Time with two feet on the ground or fewer (s).
        stance_shortest: Shortest stance (s).
        swing_shortest: Shortest swing (s).
        swing_longest: Longest swing (s).
        height_deviation: Largest departure of the base from its nominal height (m).
        tilt: Largest roll or pitch (rad).
        vertical_speed: Fastest rise or fall of the base (m/s).
        vertical_energy_swing: Largest swing within half a second of the energy of the base's
            vertical motion over its weight, z + ż²/2g (m); a jump swings by its height or more.
        landing_force: Largest vertical force of a foot within 0.1 s of its touch-down (weights).
        landing_rate: Fastest rise of that force (weights/s).
        landing_speed: Fastest sinking of the base at a touch-down (m/s).
        closest_footholds: Distance of each obstacle line to its closest foothold (m).
    """

    linear_residual_peak: float
    linear_residual_rms: float
    angular_residual_peak: float
    angular_residual_rms: float
    drift: float
    stance_overshoot: float
    swing_overshoot: float
    friction_excess: float
    pull: float
    contact_change_force: float
    force_peak: float
    stance_slip: float
    stance_height: float
    swing_depth: float
    fewest_feet_down: int
    flight_time: float
    support_least: float
    sparse_support_time: float
    stance_shortest: float
    swing_shortest: float
    swing_longest: float
    height_deviation: float
    tilt: float
    vertical_speed: float
    vertical_energy_swing: float
    landing_force: float
    landing_rate: float
    landing_speed: float
    closest_footholds: tuple[float, ...]

    @property
    def closest_foothold(self) -> float:
        """Distance (m) of the closest foothold to any line, infinite without any."""
        return float(np.min(self.closest_footholds, initial=np.inf))

    def as_dict(self) -> dict[str, float]:
        """All figures by name; lines are numbered from one, ``closest_foothold_1`` and so on."""
        figures = {name: float(getattr(self, name)) for name in _SINGLE_FIGURES}
        lines = enumerate(self.closest_footholds, start=1)
        return figures | {f"{_LINE_FIGURE}{number}": value for number, value in lines}

    @classmethod
    def from_dict(cls, figures: Mapping[str, float]) -> Self:
        """The inverse of :meth:`as_dict`, for solutions that were measured before.

        Raises:
            DataError: A figure is missing.
        """
        missing = [name for name in _SINGLE_FIGURES if name not in figures]
        if missing:
            raise DataError(f"violations: {', '.join(missing)} are missing; measure once more")
        single: dict[str, Any] = {name: figures[name] for name in _SINGLE_FIGURES}
        single["fewest_feet_down"] = int(single["fewest_feet_down"])
        lines = sum(name.startswith(_LINE_FIGURE) for name in figures)
        closest = tuple(figures[f"{_LINE_FIGURE}{number}"] for number in range(1, lines + 1))
        return cls(**single, closest_footholds=closest)


_SINGLE_FIGURES = tuple(f.name for f in fields(Violations) if f.name != "closest_footholds")
_LINE_FIGURE = "closest_foothold_"


def measure(
    trajectory: Trajectory, robot: RobotModel, obstacles_W: Array, dt: float = 0.005
) -> Violations:
    """Measure one solution (no batch axes) at samples ``dt`` seconds apart.

    Args:
        trajectory: The solution, world frame.
        robot: Mass, inertia, range of motion and friction.
        obstacles_W: Obstacle lines, (n, 3).
        dt: Spacing of the samples (s).

    Raises:
        DataError: The trajectory has batch axes or is not finite.
    """
    _require_measurable(trajectory)
    start, end = float(trajectory.base_start), float(trajectory.base_end)
    times: Array = start + dt * np.arange(round((end - start) / dt) + 1, dtype=np.float64)
    base, feet = rigid_motion(trajectory, times), sample_feet(trajectory, times)
    landing = landings(trajectory, robot)
    return Violations(
        **_balance(base, feet, robot, dt),
        **_forces(trajectory, feet, robot),
        **_feet(trajectory, base, feet, robot),
        **_support(feet, robot, dt),
        fewest_feet_down=int(feet.contact.sum(axis=-1).min()),
        **_posture(base, robot),
        vertical_speed=float(np.abs(base.velocity[:, 2]).max()),
        vertical_energy_swing=vertical_energy_swing(base, dt),
        landing_force=landing.force,
        landing_rate=landing.rate,
        landing_speed=landing.speed,
        closest_footholds=closest_footholds(trajectory, obstacles_W),
    )


def _require_measurable(trajectory: Trajectory) -> None:
    if trajectory.batch_shape:
        raise DataError(
            f"measure: takes one solution at a time, got batch axes {trajectory.batch_shape}; "
            "index the batch"
        )
    if not trajectory.is_finite():
        raise DataError("measure: the trajectory holds NaN or infinity; leave this solution out")


def _balance(
    base: RigidMotion, feet: FootSamples, robot: RobotModel, dt: float
) -> dict[str, float]:
    linear = np.linalg.norm(linear_residual(base, feet, robot), axis=-1)
    angular = np.linalg.norm(angular_residual(base, feet, robot), axis=-1)
    return {
        "linear_residual_peak": float(linear.max()),
        "linear_residual_rms": float(np.sqrt(np.mean(linear**2))),
        "angular_residual_peak": float(angular.max()),
        "angular_residual_rms": float(np.sqrt(np.mean(angular**2))),
        "drift": float(np.median(open_loop_drift(base, feet, robot, dt))),
    }


def _forces(trajectory: Trajectory, feet: FootSamples, robot: RobotModel) -> dict[str, float]:
    force = feet.force / robot.weight
    normal = force[..., 2]
    tangential = np.abs(force[..., :2]).max(axis=-1)
    excess = np.where(feet.contact, tangential - robot.friction * np.maximum(normal, 0.0), 0.0)
    shared = [trajectory.force_nodes[:, :-1, -1, 0], trajectory.force_nodes[:, 1:, 0, 0]]
    jump = np.linalg.norm(np.concatenate(shared, axis=1) / robot.weight, axis=-1)
    return {
        "friction_excess": max(0.0, float(excess.max())),
        "pull": max(0.0, float(-normal.min())),
        "contact_change_force": float(jump.max(initial=0.0)),
        "force_peak": float(np.linalg.norm(force, axis=-1).max()),
    }


def _feet(
    trajectory: Trajectory, base: RigidMotion, feet: FootSamples, robot: RobotModel
) -> dict[str, float]:
    stance_overshoot, swing_overshoot = range_of_motion_overshoot(base, feet, robot)
    stance_height, swing_depth = height_errors(feet)
    stances, swings = phase_durations(trajectory)
    return {
        "stance_overshoot": stance_overshoot,
        "swing_overshoot": swing_overshoot,
        "stance_slip": stance_slip(feet),
        "stance_height": stance_height,
        "swing_depth": swing_depth,
        "stance_shortest": float(stances.min()),
        "swing_shortest": float(swings.min(initial=np.inf)),
        "swing_longest": float(swings.max(initial=0.0)),
    }


def _support(feet: FootSamples, robot: RobotModel, dt: float) -> dict[str, float]:
    return {
        "flight_time": dt * int(in_flight(feet, robot).sum()),
        "support_least": float(support(feet, robot).min()),
        "sparse_support_time": dt * int((feet.contact.sum(axis=-1) <= 2).sum()),
    }


def _posture(base: RigidMotion, robot: RobotModel) -> dict[str, float]:
    return {
        "height_deviation": float(np.abs(base.position[:, 2] - robot.nominal_height).max()),
        "tilt": float(np.abs(base.rpy[:, :2]).max()),
    }
