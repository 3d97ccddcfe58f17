"""What the values of each table must be, beyond their types: lengths, ranges, known words.

A rule is data: a condition in SQL over one row. A condition that is null holds, so a column that
may be missing needs no exception of its own.
"""

from dataclasses import dataclass

from services.lake.schemas import SEGMENT_SIZE, TASK_SIZE

FEET = 4

FORCE_NUMBERS = 18
"""Per stance and foot: three nodes of value and derivative of a force in space."""

STATUSES = ("converged", "iteration_limit", "time_limit", "infeasible", "diverged", "error")
SPLITS = ("train", "validation")
OUTCOMES = ("completed", "diverged")
PURPOSES = ("report", "tuning")


@dataclass(frozen=True)
class Rule:
    """A condition on every row of a table.

    Attributes:
        says: The condition in words.
        holds: The same in SQL.
        kind: ``length`` or ``range``.
    """

    says: str
    holds: str
    kind: str = "range"


def _length(column: str, expected: str | int) -> Rule:
    return Rule(f"{column} holds {expected} values", f"len({column}) = {expected}", "length")


def _multiple(column: str, of: str | int) -> Rule:
    holds = f"len({column}) % ({of}) = 0"
    return Rule(f"{column} holds a multiple of {of} values", holds, "length")


def _one_of(column: str, words: tuple[str, ...]) -> Rule:
    listed = ", ".join(f"'{word}'" for word in words)
    return Rule(f"{column} is one of {', '.join(words)}", f"{column} IN ({listed})")


def _at_least(column: str, least: int) -> Rule:
    return Rule(f"{column} is at least {least}", f'"{column}" >= {least}')


def _ascending_by_foot() -> Rule:
    """Times of a foot's contact changes ascend, in a trajectory that the solver vouches for."""
    feet = (
        f"contact_times[{foot} * 2 * n_stances + 1 : {foot + 1} * 2 * n_stances]"
        for foot in range(FEET)
    )
    ascending = " AND ".join(f"list_sort({times}) = {times}" for times in feet)
    return Rule("contact_times of each foot ascend", f"status <> 'converged' OR ({ascending})")


_SOLUTIONS = (
    _at_least("index", 0),
    _one_of("status", STATUSES),
    Rule("accepted rows have no reject_reasons", "accepted = (len(reject_reasons) = 0)"),
    Rule("accepted rows converged", "NOT accepted OR status = 'converged'"),
    Rule(
        "accepted rows have a trajectory and a finite cost",
        "NOT accepted OR (base_nodes IS NOT NULL AND coalesce(isfinite(cost), false))",
    ),
    _at_least("iterations", 0),
    _at_least("solve_cpu_s", 0),
    _at_least("liftoff_swaps", 0),
    Rule(
        "gait_order names each foot once",
        f"list_sort(gait_order) = {list(range(FEET))}::TINYINT[]",
    ),
    _length("start_pose", 3),
    _length("start_feet", 2 * FEET),
    _length("goal_pose", 3),
    _multiple("obstacles", 3),
    _length("noise_amplitudes", 9),
    _multiple("noise_timing", 2 * FEET),
    _at_least("n_stances", 1),
    _multiple("base_nodes", 12),
    _length("contact_times", f"{2 * FEET} * n_stances"),
    _length("footholds", f"{3 * FEET} * n_stances"),
    _length("swing_nodes", f"{5 * FEET} * (n_stances - 1)"),
    _length("force_nodes", f"{FEET * FORCE_NUMBERS} * n_stances"),
    _length("guess_footholds", f"{3 * FEET} * n_stances"),
    _ascending_by_foot(),
)

_SEGMENTS = (
    _at_least("solution_index", 0),
    _one_of("split", SPLITS),
    _at_least("epoch_s", 0),
    Rule("goal_time_s lies after epoch_s", "goal_time_s > epoch_s"),
    _length("x", TASK_SIZE),
    _length("tau", SEGMENT_SIZE),
)

_SAMPLED = (
    ("base_pos_W", 3),
    ("base_rpy", 3),
    ("base_linvel_W", 3),
    ("base_angvel_W", 3),
    ("foot_pos_W", 3 * FEET),
    ("foot_force_W", 3 * FEET),
    ("foot_contact", FEET),
)

_ROLLOUTS = (
    _at_least("index", 0),
    _one_of("outcome", OUTCOMES),
    _at_least("duration_s", 0),
    _multiple("obstacles", 3),
    _multiple("clearances", FEET),
    Rule("t ascends", "list_sort(t) = t"),
    *(_length(column, f"{size} * len(t)") for column, size in _SAMPLED),
    *(
        _length(f"foothold_{name}", "len(foothold_foot)")
        for name in ("x", "y", "touchdown", "liftoff")
    ),
)

RULES: dict[str, tuple[Rule, ...]] = {
    "datasets": (),
    "solutions": _SOLUTIONS,
    "cuts": (),
    "segments": _SEGMENTS,
    "models": (_at_least("segments_version", 0), _at_least("latent", 0)),
    "evaluations": (
        _at_least("segments_version", 0),
        _at_least("latent", 0),
        _one_of("purpose", PURPOSES),
    ),
    "rollouts": _ROLLOUTS,
}
"""Conditions on the rows of each table."""

_LAST_ITERATE = "of the last iterate, whatever became of it; accepted rows have their own rule"

MAY_BE_NAN: dict[str, dict[str, str]] = {
    "solutions": {
        "cost": _LAST_ITERATE,
        "cost_terms": _LAST_ITERATE,
        "constraint_violation": _LAST_ITERATE,
        "violations": "infinite where there is nothing to measure: no swing, no foothold",
    },
    "evaluations": {"summary": "rates over nothing: no line crossed, no step replanned"},
}
"""Columns that may hold NaN or infinity, and why; all other numbers must be finite."""
