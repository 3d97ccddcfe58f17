"""The comparison of replanners: the distributions of Fig. 4, the trade-off, and the table."""

from collections.abc import Sequence
from math import isfinite

from lmtr.figures.distributions import distribution_figure
from lmtr.figures.style import series_styles
from lmtr.figures.trade_off import TradeOff, trade_off_figure
from pipelines.report.page import Cell, Picture, Section, Table
from pipelines.report.results import EXPERT, Evaluation


def comparison_section(evaluations: Sequence[Evaluation], expert: Evaluation) -> Section:
    """The two distributions of Fig. 4 and the table of replanners."""
    compared = [expert, *evaluations]
    styles = series_styles(e.label for e in compared)
    judged = [e for e in compared if len(e.clearances) and len(e.violations)]
    criteria = expert.criteria
    close, severe = 100 * criteria.clearance, 100 * criteria.large_violation
    return Section(
        "Comparison of replanners",
        [
            Picture(
                "distributions",
                distribution_figure(
                    {e.label: [e.clearances] for e in judged},
                    {e.label: [e.violations] for e in judged},
                    close=criteria.clearance,
                    severe=criteria.large_violation,
                    styles=styles,
                ),
                "Left: closest foothold of each foot to each line crossed. Right: how far "
                f"contacting feet leave the ±{criteria.forward_limit:g} m forward range of motion "
                "(on a logarithmic axis). The expert on its own tasks is the line of reference.",
                "Densities of closest foothold distance and of range-of-motion violation.",
            ),
            Picture(
                "trade-off",
                trade_off_figure(
                    {
                        e.label: [
                            TradeOff(e.summary["close_share"], 1e3 * e.summary["mean_violation"])
                        ]
                        for e in judged
                    },
                    styles=styles,
                ),
                "Obstacle avoidance against kinematic violation; the best corner is lower left.",
                "Share of close steps against mean violation, one point per replanner.",
            ),
            Table(
                "Replanners. Close: share of (line, foot) pairs with the closest foothold within "
                f"{close:g} cm, with a 95 % interval by bootstrap over rollouts. Jumps: medians at "
                "replanning. Plan: time per plan in a batch.",
                [
                    "replanner",
                    "rollouts",
                    "diverged",
                    "lines crossed",
                    "close (%)",
                    "mean violation (mm)",
                    f"over {severe:g} cm (%)",
                    "distance (m)",
                    "velocity jump (m/s)",
                    "foot jump (mm)",
                    "plan (µs)",
                    "memory (MB)",
                ],
                [_replanner_row(e) for e in compared],
            ),
        ],
    )


def headline(evaluations: Sequence[Evaluation]) -> str:
    """The finding in a sentence."""
    parts = []
    for evaluation in evaluations:
        share = evaluation.summary["close_share"]
        close = f"{100.0 * share:.1f} %" if isfinite(share) else "no line crossed"
        violation = 1e3 * evaluation.summary["mean_violation"]
        parts.append(f"{evaluation.label} {close} and {violation:.2f} mm")
    within = 100 * evaluations[0].criteria.clearance
    return (
        f"Share of steps with a foothold within {within:g} cm of an obstacle line, and mean "
        f"violation of the forward range of motion: {'; '.join(parts)}."
    )


def _replanner_row(evaluation: Evaluation) -> list[Cell]:
    summary = evaluation.summary
    close: str | None = None
    if isfinite(summary["close_share"]):
        close = f"{100 * summary['close_share']:.1f}"
        if evaluation.label != EXPERT:
            low, high = (100 * summary[f"close_share_{end}"] for end in ("low", "high"))
            close += f" ({low:.1f}–{high:.1f})"

    def scaled(key: str, scale: float) -> float | None:
        return scale * summary[key] if key in summary else None

    return [
        evaluation.label,
        int(summary["rollouts"]),
        int(summary["diverged"]) if "diverged" in summary else None,
        int(summary["obstacles_crossed"]),
        close,
        scaled("mean_violation", 1e3),
        scaled("large_violation_share", 100.0),
        scaled("distance", 1.0),
        scaled("velocity_jump", 1.0),
        scaled("foot_jump", 1e3),
        scaled("plan_seconds", 1e6),
        scaled("nbytes", 1e-6),
    ]
