"""Settings of the rollout testbed and of its judgement (Sec. 5.1, 5.2)."""

from math import ceil

from pydantic import model_validator

from lmtr.settings import NonNegative, Positive, PositiveRange, Settings
from lmtr.trajectory.trajectory import BASE_STEP
from lmtr.vectors.layout import SEGMENT_DURATION


class PlausibleRange(Settings):
    """States outside of which a rollout has diverged: no walking robot could be there.

    Far wider than anything in expert data, so that they tell divergence from bad quality.

    Attributes:
        height: Least and greatest height of the base, as shares of the robot's nominal height.
        tilt: Greatest roll and pitch, either way (rad).
        speed: Greatest linear speed of the base (m/s).
        foot_offset: Greatest horizontal distance of a foot from its neutral position (m).
    """

    height: tuple[Positive, Positive] = (0.5, 1.5)
    tilt: Positive = 1.0
    speed: Positive = 1.5
    foot_offset: Positive = 0.6

    @model_validator(mode="after")
    def _heights_ascend(self) -> "PlausibleRange":
        low, high = self.height
        if low >= 1.0 or high <= 1.0:
            raise ValueError(
                f"height must enclose 1, the nominal height, got ({low}, {high}); widen it"
            )
        return self


class RolloutSettings(Settings):
    """How rollouts are run.

    Attributes:
        period: Replanning period Δt, a multiple of the base nodes' spacing (s).
        duration: Length of a rollout, a multiple of the period (s).
        goal_distance: How far ahead of the base, along the world's x axis, the mission puts the
            goal (m). It must lie inside the training distribution of γ: base poses of the same
            solution seconds later, which a walk of 0.4 m/s has 0.4 to 1.6 m ahead.
        first_obstacle: Distance of the first line from the start (m).
        obstacle_spacing: Forward distance from one line to the next (m). The defaults of all three
            are those of expert tasks, and put the paper's 13 lines on 11 m.
        obstacle_turn: Greatest turn of a line away from square to the x axis (rad).
        landing_time: How long a foot takes to the ground that is still in the air while the plan
            believes that it stands (s).
        plausible: Limits beyond which a rollout ends as diverged.
    """

    period: Positive = 0.3
    duration: Positive = 30.0
    goal_distance: Positive = 0.8
    first_obstacle: PositiveRange = (0.7, 1.1)
    obstacle_spacing: PositiveRange = (0.5, 1.1)
    obstacle_turn: NonNegative = 0.5
    landing_time: Positive = 0.05
    plausible: PlausibleRange = PlausibleRange()

    @model_validator(mode="after")
    def _times_are_multiples(self) -> "RolloutSettings":
        for name, unit_name, unit in (
            ("period", "base nodes' spacing", BASE_STEP),
            ("duration", "period", self.period),
        ):
            value = getattr(self, name)
            if abs(value / unit - round(value / unit)) > 1e-6 or round(value / unit) < 1:
                raise ValueError(
                    f"{name} must be a multiple of the {unit_name}, {unit} s, got {value} s; "
                    f"take {max(round(value / unit), 1) * unit:g} s"
                )
        if self.period > SEGMENT_DURATION:
            raise ValueError(
                f"period must not exceed a segment's {SEGMENT_DURATION} s, got {self.period} s; "
                "shorten it"
            )
        return self

    @model_validator(mode="after")
    def _feet_land_in_time(self) -> "RolloutSettings":
        if self.landing_time >= self.period:
            raise ValueError(
                f"landing_time must be shorter than the period {self.period} s, "
                f"got {self.landing_time} s; shorten it"
            )
        return self

    @property
    def steps_per_cycle(self) -> int:
        """Base nodes accumulated in each cycle."""
        return round(self.period / BASE_STEP)

    @property
    def n_cycles(self) -> int:
        """Replanning cycles of a rollout; the paper has 100."""
        return round(self.duration / self.period)

    @property
    def n_lines(self) -> int:
        """Obstacle lines of a course: enough for the fastest plausible robot on all of them."""
        reach = self.plausible.speed * self.duration + self.goal_distance
        return ceil(reach / self.obstacle_spacing[0]) + 2


class Criteria(Settings):
    """What Sec. 5.2 calls a close step and a violated range of motion.

    Attributes:
        clearance: A closest foothold nearer to a line than this is close (m).
        forward_limit: Half the box in which contacting feet should stay, forward of and behind
            neutral (m); wider than the one that the expert keeps (``range_of_motion``).
        large_violation: A foot further outside the box than this violates it grossly (m).
        friction_excess: A planned force that leaves the friction pyramid by more than this counts
            as such (weights of the robot); the expert's own filter allows 0.001.
    """

    clearance: Positive = 0.05
    forward_limit: Positive = 0.2
    large_violation: Positive = 0.05
    friction_excess: NonNegative = 0.005
