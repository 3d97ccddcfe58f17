"""The rules of the quality filter: which figure is held to which threshold, and what it means."""

from typing import NamedTuple

from lmtr.errors import DataError


class Rule(NamedTuple):
    """One figure of a solution against one threshold.

    Attributes:
        reason: Name of the reason for refusal; rules may share it.
        figure: Name of the figure, an attribute of :class:`~lmtr.quality.measure.Violations`.
        threshold: Its threshold, an attribute of :class:`~lmtr.quality.filter.QualityThresholds`.
        unit: Unit of both.
        at_least: Whether the figure must reach the threshold instead of staying within it.
    """

    reason: str
    figure: str
    threshold: str
    unit: str
    at_least: bool = False

    def broken(self, figure: float, threshold: float) -> bool:
        """Whether a figure breaks the rule; what is not a number does."""
        return not (figure >= threshold if self.at_least else figure <= threshold)


RULES = (
    Rule("linear_residual", "linear_residual_peak", "linear_residual", "m/s²"),
    Rule("angular_residual", "angular_residual_peak", "angular_residual", "rad/s²"),
    Rule("drift", "drift", "drift", "m"),
    Rule("stance_range_of_motion", "stance_overshoot", "stance_overshoot", "m"),
    Rule("swing_range_of_motion", "swing_overshoot", "swing_overshoot", "m"),
    Rule("friction", "friction_excess", "friction_excess", "weights"),
    Rule("pull", "pull", "pull", "weights"),
    Rule("contact_change_force", "contact_change_force", "contact_change_force", "weights"),
    Rule("force_peak", "force_peak", "force_peak", "weights"),
    Rule("slip", "stance_slip", "stance_slip", "m"),
    Rule("off_ground", "stance_height", "stance_height", "m"),
    Rule("below_ground", "swing_depth", "swing_depth", "m"),
    Rule("flight", "flight_time", "flight_time", "s"),
    Rule("energetic_jumping", "vertical_speed", "vertical_speed", "m/s"),
    Rule("energetic_jumping", "vertical_energy_swing", "vertical_energy_swing", "m"),
    Rule("hard_landing", "landing_force", "landing_force", "weights"),
    Rule("hard_landing", "landing_rate", "landing_rate", "weights/s"),
    Rule("hard_landing", "landing_speed", "landing_speed", "m/s"),
    Rule("phase_too_short", "stance_shortest", "phase_shortest", "s", at_least=True),
    Rule("phase_too_short", "swing_shortest", "phase_shortest", "s", at_least=True),
    Rule("height", "height_deviation", "height_deviation", "m"),
    Rule("tilt", "tilt", "tilt", "rad"),
    Rule("obstacle", "closest_foothold", "obstacle_clearance", "m", at_least=True),
)

NOT_CONVERGED = "not_converged"
SATURATED = "saturated"
COST = "cost"

_SENTENCES = {
    "linear_residual": "The forces do not explain the base's acceleration between the nodes.",
    "angular_residual": "The moments do not explain the base's rotation between the nodes.",
    "drift": "Following the planned forces without feedback leads away from the planned motion.",
    "stance_range_of_motion": "A standing foot leaves its range of motion.",
    "swing_range_of_motion": "A swinging foot leaves its range of motion.",
    "friction": "A foot pushes sideways more than friction holds.",
    "pull": "A foot pulls at the ground.",
    "contact_change_force": "A foot pushes at the instant of touch-down or lift-off.",
    "force_peak": "One foot carries more than the robot's legs can.",
    "slip": "A foot moves while it stands.",
    "off_ground": "A standing foot is not on the ground.",
    "below_ground": "A swinging foot goes below the ground.",
    "flight": "The robot flies: at some time no foot stands, or those that do bear nothing.",
    "energetic_jumping": "The base is thrown up or dropped as in a jump, which walking needs not.",
    "hard_landing": "A foot lands hard: under a sinking base, or taking up its load at a blow.",
    "phase_too_short": "A stance or swing is shorter than legs can follow.",
    "height": "The base crouches or rises too far.",
    "tilt": "The base rolls or pitches too far.",
    "obstacle": "A foothold lies on an obstacle line.",
    COST: "The solution is much dearer than others of such tasks: a poor local optimum.",
}
_DETAILED = {
    NOT_CONVERGED: "The optimizer stopped without a solution: {}.",
    SATURATED: "The solution lies on a limit that the problem was given, not the robot: {}.",
}
REASONS = (*_SENTENCES, *_DETAILED)
"""Stable names of the reasons for which solutions are refused; the last two name a detail too."""


def with_detail(reason: str, detail: str) -> str:
    """The reason with what it is about, ``not_converged:diverged`` or ``saturated:height``."""
    return f"{reason}:{detail}"


def describe(reason: str) -> str:
    """A sentence for a reason of a verdict.

    Raises:
        DataError: No verdict gives this reason.
    """
    kind, _, detail = reason.partition(":")
    if kind in _DETAILED and detail:
        return _DETAILED[kind].format(detail.replace("_", " "))
    if reason not in _SENTENCES:
        raise DataError(f"reason {reason!r} is unknown; verdicts give {', '.join(REASONS)}")
    return _SENTENCES[reason]
