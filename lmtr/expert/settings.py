"""Settings of the expert: its scope, the weights of its costs, its limits and its solver."""

import hashlib
import json
from math import lcm
from typing import Annotated

from pydantic import model_validator

from lmtr.robot.model import N_FEET, RobotModel
from lmtr.settings import Count, NonNegative, Positive, Settings, ascending
from lmtr.trajectory.trajectory import BASE_STEP

Bounds = Annotated[tuple[Positive, Positive], ascending(strictly=True)]
"""Lower and upper bound; an interior point needs room between them."""

SLACK = 1e-9
"""What rounding may add to sums and ratios of settings."""

BALANCE_SAMPLES_PER_KNOT = 2
"""Samples per knot whose weighted means the balance of forces and moments holds for."""

LEAST_DURATION = 0.4
"""Shortest duration (s) whose base spline has a point of its own between its two static ends."""


class Scope(Settings):
    """The long scope s̄ = (T̄, N̄_p) and the nominal walk that fills it.

    Attributes:
        duration: T̄, a multiple of the base's knot spacing (s).
        n_swings: N̄_p, swings per leg.
        swing_share: Nominal duration of a swing as a share of T̄/(N̄_p + ½).
        first_liftoff: Nominal time of the first lift-off, and of rest at the end (s).
        clearance: Height of the middle of a swing (m).
    """

    duration: Positive = 7.5
    n_swings: Count = 6
    swing_share: Positive = 0.28
    first_liftoff: Positive = 0.4
    clearance: Positive = 0.08

    @model_validator(mode="after")
    def _nominal_walk_exists(self) -> "Scope":
        knots = self.duration / BASE_STEP
        if self.duration < LEAST_DURATION - SLACK or abs(knots - round(knots)) > 1e-6:
            raise ValueError(
                f"duration must be a multiple of {BASE_STEP} s from {LEAST_DURATION} s up, got "
                f"{self.duration}"
            )
        if self.nominal_cycle <= self.nominal_swing:
            raise ValueError(
                f"duration {self.duration} s leaves a cycle of {self.nominal_cycle:.3g} s for a "
                f"swing of {self.nominal_swing:.3g} s and a stance, with first_liftoff "
                f"{self.first_liftoff} s and swing_share {self.swing_share}; lower these two or "
                "raise the duration"
            )
        return self

    @property
    def n_nodes(self) -> int:
        """Base nodes, one every 0.1 s and one at each end."""
        return round(self.duration / BASE_STEP) + 1

    @property
    def n_stances(self) -> int:
        """Stances per leg."""
        return self.n_swings + 1

    @property
    def nominal_swing(self) -> float:
        """Nominal duration of a swing (s)."""
        return self.swing_share * self.duration / (self.n_swings + 0.5)

    @property
    def nominal_cycle(self) -> float:
        """Nominal time between two lift-offs of one foot (s)."""
        return (self.duration - 2.0 * self.first_liftoff - self.nominal_swing) / (
            self.n_swings - 1 + 0.75
        )


class CostWeights(Settings):
    """Weights of the expert's costs (E22–E24); every one may be changed without recompiling.

    Attributes:
        acceleration: On ∫|r̈|² dt (per m²/s³).
        angular_acceleration: On ∫|(roll, pitch, yaw)¨|² dt (per rad²/s³).
        tilt: On ∫(roll² + pitch²) dt (per rad²·s).
        height: On ∫(z − nominal)² dt (per m²·s).
        foot_offset: On the integrated square of each foot's offset from neutral, in half sides of
            its range of motion (per s). Without it the optimum is so flat that an early stop
            leaves footholds decimetres away from it.
        horizontal_force: On the squared horizontal part of the force points (per weight²).
        force_slope: On the mean squared slope of each force cubic, over its own unit time.
        force_curvature: On the mean squared curvature of each force cubic, likewise.
        swing_offset: On the squared offset of a swing's middle (per m²).
        swing_drift: On the squared extra velocity of a swing's middle times the swing's duration
            (per m²).
    """

    acceleration: NonNegative = 0.02
    angular_acceleration: NonNegative = 0.01
    tilt: NonNegative = 0.4
    height: NonNegative = 2.5
    foot_offset: NonNegative = 0.03
    horizontal_force: NonNegative = 0.02
    force_slope: NonNegative = 0.02
    force_curvature: NonNegative = 0.004
    swing_offset: NonNegative = 1.0
    swing_drift: NonNegative = 1.0


class Limits(Settings):
    """Bounds of the expert's problem; friction and range of motion are the robot's.

    Attributes:
        swing: Shortest and longest swing (s).
        stance: Shortest and longest stance (s); the first and last ones have no longest.
        window: Largest departure of a contact change from the nominal timing (s). It says which
            samples can meet which phases, and so how sparse the problem is; solutions that touch
            it are flagged.
        force: Largest vertical force of one foot (weights).
        height: Largest departure of the base from its nominal height (m).
        tilt: Largest roll and pitch (rad).
        swing_height: Lowest and highest middle of a swing above the ground (m).
    """

    swing: Bounds = (0.25, 0.7)
    stance: Bounds = (0.3, 2.5)
    window: Positive = 0.5
    force: Positive = 1.5
    height: Positive = 0.15
    tilt: Positive = 0.6
    swing_height: Bounds = (0.04, 0.16)

    @model_validator(mode="after")
    def _feet_carry_the_robot(self) -> "Limits":
        if self.force * N_FEET <= 1.0:
            raise ValueError(
                f"force must exceed 1/{N_FEET} of the weight for {N_FEET} feet to carry the "
                f"robot, got {self.force}; raise it"
            )
        return self


class SolverSettings(Settings):
    """Settings of the interior-point method.

    Attributes:
        max_iterations: Iterations after which a solve is given up.
        time_limit: Processor time after which it is given up (s). It only keeps a solve that
            hangs from holding a run; a limit that others meet makes data depend on the machine.
        tolerance: Scaled optimality at which a solve has converged.
        constraint_tolerance: Largest constraint violation of a converged solve (scaled rows).
        early_objective_change: Relative change of the cost over an iteration below which a nearly
            feasible iterate counts as converged (E37): the last digits of the cost move no
            foothold.
        early_iterations: Iterations in a row that must be so.
        proximal: Hessian-only damping ρ of contact times and footholds (E29); it takes the place of
            curvature that is left out on purpose and moves no optimum.
    """

    max_iterations: Count = 200
    time_limit: Positive = 120.0
    tolerance: Positive = 1e-3
    constraint_tolerance: Positive = 1e-4
    early_objective_change: Positive = 2e-4
    early_iterations: Count = 3
    proximal: NonNegative = 2.0


class ExpertSettings(Settings):
    """Everything that defines the expert but the robot.

    Attributes:
        scope: Duration and swings per leg.
        obstacle_weight: Height of each line's potential at each foothold.
        obstacle_sigma: Standard deviation of the potential across the line (m).
        costs: Weights of the other costs.
        limits: Bounds.
        range_of_motion_step: Spacing of the samples at which the range of motion holds (s); with
            0.1 s stance feet leave it by centimetres in between.
        range_of_motion_margin: How far inside its box a foot stays at these samples (m), for it
            goes a little further in between.
        solver: Settings of the solver.
    """

    scope: Scope = Scope()
    obstacle_weight: NonNegative = 1.0
    obstacle_sigma: Positive = 0.08
    costs: CostWeights = CostWeights()
    limits: Limits = Limits()
    range_of_motion_step: Positive = 0.05
    range_of_motion_margin: NonNegative = 0.008
    solver: SolverSettings = SolverSettings()

    def cost_key(self, robot: RobotModel) -> str:
        """Short digest of what the costs of a robot's walks depend on.

        That is the robot's figures and all settings but the solver's. Costs of solutions can be
        compared where it is the same.
        """
        parts = [robot.model_dump(exclude={"name"}), self.model_dump(exclude={"solver"})]
        return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:12]

    @property
    def samples_per_knot(self) -> int:
        """Samples of the range of motion from one base node to the next."""
        return round(BASE_STEP / self.range_of_motion_step)

    @property
    def base_samples_per_knot(self) -> int:
        """Samples of the base's motion per knot: those of range of motion and of the balance."""
        return lcm(self.samples_per_knot, BALANCE_SAMPLES_PER_KNOT)

    @model_validator(mode="after")
    def _samples_divide_knots(self) -> "ExpertSettings":
        ratio = BASE_STEP / self.range_of_motion_step
        if ratio < 1.0 - SLACK or abs(ratio - round(ratio)) > SLACK:
            raise ValueError(
                f"range_of_motion_step must divide the base's knot spacing {BASE_STEP} s, got "
                f"{self.range_of_motion_step}; use 0.1, 0.05 or 0.025"
            )
        return self

    @model_validator(mode="after")
    def _phases_fit(self) -> "ExpertSettings":
        """The shortest phases of a leg fit into the duration."""
        scope, limits = self.scope, self.limits
        needed = scope.n_swings * limits.swing[0] + scope.n_stances * limits.stance[0]
        if needed > scope.duration + SLACK:
            raise ValueError(
                f"scope.duration must hold {scope.n_swings} swings of at least {limits.swing[0]} s "
                f"and {scope.n_stances} stances of at least {limits.stance[0]} s, {needed:.2f} s "
                f"in all, got {scope.duration}; raise it, or lower scope.n_swings, limits.swing "
                "or limits.stance"
            )
        return self

    @model_validator(mode="after")
    def _nominal_walk_is_within_limits(self) -> "ExpertSettings":
        """The nominal walk, around which timing windows are laid, keeps the limits itself."""
        scope, limits = self.scope, self.limits
        _require_between(
            "the nominal swing", scope.nominal_swing, limits.swing, "scope.swing_share"
        )
        if scope.n_swings > 1:  # otherwise no stance lies between two swings
            stance = scope.nominal_cycle - scope.nominal_swing
            remedy = "scope.n_swings or scope.duration"
            _require_between("the nominal stance", stance, limits.stance, remedy)
        first = (limits.stance[0], scope.duration)
        _require_between("scope.first_liftoff", scope.first_liftoff, first, "it or limits.stance")
        _require_between("scope.clearance", scope.clearance, limits.swing_height, "it")
        return self


def _require_between(what: str, value: float, bounds: tuple[float, float], remedy: str) -> None:
    low, high = bounds
    if not low - SLACK <= value <= high + SLACK:
        raise ValueError(
            f"{what} must lie between {low} and {high}, got {value:.3g}; change {remedy}"
        )
