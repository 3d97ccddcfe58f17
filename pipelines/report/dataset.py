"""The report on expert data: how many solutions, how good, how dear, and one of them in full."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from lmtr.arrays import Array
from lmtr.figures.dataset import (
    Violation,
    cost_figure,
    effort_figure,
    margin_figure,
    outcome_figure,
    violation_figure,
)
from lmtr.figures.motion_figure import motion_figure
from lmtr.geometry.line import signed_distance
from lmtr.quality.filter import QualityThresholds
from lmtr.quality.rules import describe
from lmtr.robot.model import N_FEET
from lmtr.trajectory.motion import sampled
from pipelines import records
from pipelines.report.page import Picture, Section, Table


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
