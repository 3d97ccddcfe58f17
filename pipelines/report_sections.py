"""The parts of the report, each drawn from what the lake holds."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lmtr.figures.dataset import (
    Violation,
    cost_figure,
    effort_figure,
    margin_figure,
    outcome_figure,
    violation_figure,
)
from lmtr.figures.distributions import distribution_figure
from lmtr.figures.learning import learning_figure
from lmtr.figures.motion_figure import motion_figure
from lmtr.figures.style import series_styles
from lmtr.figures.trade_off import TradeOff, trade_off_figure
from lmtr.geometry.line import signed_distance
from lmtr.models.trained import TrainedModel
from lmtr.quality.filter import QualityThresholds, describe
from lmtr.robot.model import N_FEET
from lmtr.trajectory.motion import sampled
from pipelines import records
from pipelines.report_page import Cell, Picture, Section, Table, Text
from pipelines.results import EXPERT, Evaluation

Array = NDArray[np.float64]


def dataset_section(rows: Sequence[records.Row], thresholds: QualityThresholds) -> Section:
    """The expert's solutions: how many, how good, how dear, and one of them in full.

    Args:
        rows: All rows of ``solutions`` of the data set, by index.
        thresholds: What they were judged by.
    """
    solved = [row for row in rows if row["status"] == "converged"]
    good = [row for row in rows if row["accepted"]]
    reasons = Counter(reason for row in rows for reason in row["reject_reasons"])
    return Section(
        "Expert data",
        [
            _dataset_table(rows, solved, good),
            Picture(
                "outcomes",
                outcome_figure(len(good), reasons),
                "Solutions accepted by the quality filter, and why others were not.",
                f"{len(good)} of {len(rows)} solutions accepted.",
            ),
            *([_reason_table(reasons)] if reasons else []),
            Picture(
                "costs",
                cost_figure(
                    [row["cost"] for row in good],
                    [row["cost"] for row in solved if not row["accepted"]],
                ),
                "Cost of converged solutions. It is judged against what the task predicts, "
                "so a hard task is no reason for rejection.",
                "Histogram of costs of accepted and rejected solutions.",
            ),
            Picture(
                "effort",
                effort_figure(
                    [row["solve_cpu_s"] for row in solved], [row["iterations"] for row in solved]
                ),
                "Effort of converged solves, on one core each.",
                "Histograms of CPU time and of iterations per solve.",
            ),
            Picture(
                "violations",
                violation_figure(_violations(solved, thresholds)),
                "Largest violations on a 5 ms grid, measured by code that shares no constraint "
                "with the optimizer; dashed: the filter's thresholds.",
                "Distributions of the dense violations of converged solutions.",
            ),
            *_margin(solved),
            *_expert_example(good),
        ],
    )


def training_section(models: Sequence[tuple[str, TrainedModel]]) -> Section:
    """Learning curves, and what the chosen weights do on segments they have not seen."""
    histories = {label: records.learning_history(model.history) for label, model in models}
    rows: list[list[Cell]] = []
    for label, model in models:
        best = model.best_epoch
        if best is None or best.validation is None:
            continue
        look = best.validation
        rows.append(
            [
                label,
                best.epoch,
                look.reconstruction,
                look.kl,
                look.active_dimensions,
                look.errors.base_position_mm,
                look.errors.times_ms,
                look.errors.second_foothold_mm,
                look.errors.forces_weights,
            ]
        )
    return Section(
        "Training",
        [
            Picture(
                "learning",
                learning_figure(histories),
                "Learning curves: thick on validation solutions, thin on training data (with "
                "sampled modes and noisy tasks).",
                "Loss, reconstruction error and KL divergence over epochs for each model.",
            ),
            Table(
                "Reconstruction of validation segments from their own modes, at the epoch chosen.",
                [
                    "model",
                    "epoch",
                    "mean |τ − τ̂| (std.)",
                    "KL (nats)",
                    "active dimensions",
                    "base (mm)",
                    "times (ms)",
                    "next foothold (mm)",
                    "forces (weights)",
                ],
                rows,
            ),
        ],
    )


def rollout_section(evaluations: Sequence[Evaluation], films: Sequence[Picture]) -> Section:
    """One rollout of each replanner, and films of the expert and of LMTR."""
    blocks: list[Text | Picture | Table] = [
        Text(
            "All replanners walk over the same courses. Replanning starts from the state that "
            "the last plan reaches; only what lies within the replanning period is kept."
        )
    ]
    for number, evaluation in enumerate(evaluations):
        row = evaluation.example
        if len(row["t"]) < 2:
            blocks.append(Text(f"{evaluation.label}: every rollout diverged in its first plan."))
            continue
        end = f"{row['duration_s']:.1f} s, {row['distance_m']:.1f} m"
        if row["outcome"] == "diverged":
            end += f", diverged: {row['reason']}"
        blocks.append(
            Picture(
                f"rollout-{number}",
                motion_figure(
                    records.motion_of(row),
                    records.obstacles_of(row),
                    f"{evaluation.label}: course {row['index']}",
                ),
                f"{evaluation.label} ({end}). Dots: base every 0.1 s; crosses: footholds; grey: "
                "obstacle lines. Bars: stance; white boxes: swing.",
                f"Top view and gait diagram of a rollout of {evaluation.label}.",
            )
        )
    return Section("Rollouts", [*blocks, *films])


def comparison_section(evaluations: Sequence[Evaluation], expert: Evaluation) -> Section:
    """The two distributions of Fig. 4 and the table of replanners."""
    compared = [expert, *evaluations]
    styles = series_styles(e.label for e in compared)
    judged = [e for e in compared if len(e.clearances) and len(e.violations)]
    return Section(
        "Comparison of replanners",
        [
            Picture(
                "distributions",
                distribution_figure(
                    {e.label: e.clearances for e in judged},
                    {e.label: e.violations for e in judged},
                    styles=styles,
                ),
                "Left: closest foothold of each foot to each line crossed. Right: how far "
                "contacting feet leave the ±0.2 m forward range of motion (zoomed in). The expert "
                "on its own tasks is the line of reference.",
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
                "5 cm, with a 95 % interval by bootstrap over rollouts. Jumps: medians at "
                "replanning. Plan: time per plan in a batch.",
                [
                    "replanner",
                    "rollouts",
                    "diverged",
                    "lines crossed",
                    "close (%)",
                    "mean violation (mm)",
                    "over 5 cm (%)",
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
    """The finding in a sentence or two."""
    parts = []
    for evaluation in evaluations:
        close = 100.0 * evaluation.summary["close_share"]
        violation = 1e3 * evaluation.summary["mean_violation"]
        parts.append(f"{evaluation.label} {close:.1f} % and {violation:.2f} mm")
    return (
        "Share of steps with a foothold within 5 cm of an obstacle line, and mean violation of "
        f"the forward range of motion: {'; '.join(parts)}."
    )


def _dataset_table(
    rows: Sequence[records.Row], solved: Sequence[records.Row], good: Sequence[records.Row]
) -> Table:
    cpu = [row["solve_cpu_s"] for row in solved]
    total_cpu = sum(row["solve_cpu_s"] or 0.0 for row in rows)
    quantiles = np.quantile(cpu, [0.5, 0.95]) if cpu else [np.nan, np.nan]
    iterations = np.median([row["iterations"] for row in solved]) if solved else np.nan
    return Table(
        "The data set.",
        ["quantity", "value"],
        [
            ["tasks", len(rows)],
            ["converged (%)", 100.0 * len(solved) / len(rows)],
            ["accepted (%)", 100.0 * len(good) / len(rows)],
            ["CPU time per solve, median (s)", float(quantiles[0])],
            ["CPU time per solve, 95th percentile (s)", float(quantiles[1])],
            ["CPU time per accepted solution (s)", total_cpu / len(good) if good else None],
            ["iterations, median", float(iterations)],
            [
                "solutions whose order of lift-offs changed",
                sum(r["liftoff_swaps"] > 0 for r in solved),
            ],
        ],
    )


def _reason_table(reasons: Counter[str]) -> Table:
    return Table(
        "Reasons for rejection; a solution may have several.",
        ["reason", "solutions", "meaning"],
        [[reason, count, describe(reason)] for reason, count in reasons.most_common()],
    )


def _violations(
    solved: Sequence[records.Row], thresholds: QualityThresholds
) -> dict[str, Violation]:
    """Panels of the violation figure: title, values, threshold."""
    found = [dict(row["violations"]) for row in solved]

    def panel(key: str, unit: str, limit: float, scale: float = 1.0) -> Violation:
        return Violation(scale * np.array([each[key] for each in found]), unit, scale * limit)

    return {
        "linear residual": panel("linear_residual_peak", "m/s²", thresholds.linear_residual),
        "angular residual": panel("angular_residual_peak", "rad/s²", thresholds.angular_residual),
        "open-loop drift in 0.8 s": panel("drift", "mm", thresholds.drift, 1e3),
        "stance range of motion": panel("stance_overshoot", "mm", thresholds.stance_overshoot, 1e3),
        "swing range of motion": panel("swing_overshoot", "mm", thresholds.swing_overshoot, 1e3),
        "force of one foot": panel("force_peak", "weights", thresholds.force_peak),
    }


def _margin(solved: Sequence[records.Row]) -> list[Picture]:
    """How far footholds are from the lines before and after optimisation."""
    guess, solution = [], []
    for row in solved:
        lines = records.obstacles_of(row)
        guess.append(_closest(np.array(row["guess_footholds"]), lines))
        solution.append(_closest(np.array(row["footholds"]), lines))
    if not sum(map(len, guess)):
        return []
    return [
        Picture(
            "margin",
            margin_figure(np.concatenate(guess), np.concatenate(solution)),
            "Distance of the closest foothold of each foot to each line: the optimizer moves "
            "footholds away from the obstacles.",
            "Histogram of foothold distances in guesses and in solutions.",
        )
    ]


def _closest(footholds: Array, lines: Array) -> Array:
    """Distance (m) of each foot's closest free foothold to each line, (lines · feet,)."""
    feet = footholds.reshape(N_FEET, -1, 3)[:, 1:]
    return np.asarray(np.abs(signed_distance(lines[:, None, None], feet)).min(axis=-1).ravel())


def _expert_example(good: Sequence[records.Row]) -> list[Picture]:
    if not good:
        return []
    row = good[0]
    return [
        Picture(
            "expert",
            motion_figure(
                sampled(records.trajectory_of(row), 0.1),
                records.obstacles_of(row),
                f"Expert solution {row['index']}",
                goal_pose_W=np.array(row["goal_pose"]),
                with_state=True,
            ),
            "An expert solution: base every 0.1 s (dots), footholds (crosses), obstacle lines "
            "(grey), contact phases (bars).",
            "Top view, gait diagram and base state of an expert solution.",
        )
    ]


def _replanner_row(evaluation: Evaluation) -> list[Cell]:
    summary = evaluation.summary
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
