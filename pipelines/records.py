"""Between the science's types and rows of the lake: solutions, tasks, trajectories."""

import json
from collections.abc import Mapping
from dataclasses import fields
from datetime import UTC, datetime
from typing import Any

import numpy as np

from lmtr.arrays import Array
from lmtr.expert.solve import Solution
from lmtr.models.record import EpochRecord
from lmtr.quality.filter import Verdict
from lmtr.quality.measure import Violations
from lmtr.robot.model import N_FEET
from lmtr.rollout.summary import Estimate, ReplannerSummary
from lmtr.task.sampling import Noise
from lmtr.task.task import Task
from lmtr.trajectory.motion import Footholds, Motion
from lmtr.trajectory.trajectory import FORCE_PIECES, Trajectory

Row = dict[str, Any]

TRAJECTORY_COLUMNS = tuple(field.name for field in fields(Trajectory))
"""Columns of ``solutions`` that hold a trajectory in native nodes, row-major."""

MOTION_COLUMNS: tuple[tuple[str, str, tuple[int, ...]], ...] = (
    ("base_pos_W", "base_position_W", (3,)),
    ("base_rpy", "base_rpy", (3,)),
    ("base_linvel_W", "base_velocity_W", (3,)),
    ("base_angvel_W", "base_angular_velocity_W", (3,)),
    ("foot_pos_W", "foot_position_W", (N_FEET, 3)),
    ("foot_force_W", "foot_force_W", (N_FEET, 3)),
    ("foot_contact", "contact", (N_FEET,)),
)
"""Column, attribute of :class:`Motion` and shape per sample of each sampled quantity."""

FOOTHOLD_COLUMNS = (
    "foothold_foot",
    "foothold_x",
    "foothold_y",
    "foothold_touchdown",
    "foothold_liftoff",
)

ALL_MOTION_COLUMNS = ("t", *(column for column, _, _ in MOTION_COLUMNS), *FOOTHOLD_COLUMNS)
"""All columns that :func:`motion_columns` fills; empty lists where a motion is not kept."""


def task_columns(task: Task, noise: Noise) -> Row:
    """The task x̄ and the noise ξ̄ as columns."""
    return {
        "start_pose": task.start_pose_W.tolist(),
        "start_feet": task.start_feet_W.ravel().tolist(),
        "goal_pose": task.goal_pose_W.tolist(),
        "obstacles": task.obstacles_W.ravel().tolist(),
        "noise_amplitudes": noise.amplitudes.ravel().tolist(),
        "noise_timing": noise.timing.ravel().tolist(),
    }


def task_of(row: Mapping[str, Any]) -> Task:
    """The task of a row of ``solutions``."""
    return Task(
        start_pose_W=np.array(row["start_pose"]),
        start_feet_W=np.array(row["start_feet"]).reshape(N_FEET, 2),
        goal_pose_W=np.array(row["goal_pose"]),
        obstacles_W=obstacles_of(row),
    )


def trajectory_columns(trajectory: Trajectory) -> Row:
    """A trajectory in native nodes as columns."""
    columns: Row = {"n_stances": trajectory.n_stances}
    for name in TRAJECTORY_COLUMNS:
        array = np.asarray(getattr(trajectory, name), dtype=float)
        columns[name] = array.ravel().tolist() if array.ndim else float(array)
    return columns


def trajectory_of(row: Mapping[str, Any]) -> Trajectory:
    """The trajectory of a row of ``solutions``, world frame."""
    stances = row["n_stances"]
    return Trajectory(
        base_start=np.array(row["base_start"]),
        base_nodes=np.array(row["base_nodes"]).reshape(-1, 2, 6),
        contact_times=np.array(row["contact_times"]).reshape(N_FEET, 2 * stances),
        footholds=np.array(row["footholds"]).reshape(N_FEET, stances, 3),
        swing_nodes=np.array(row["swing_nodes"]).reshape(N_FEET, stances - 1, 5),
        force_nodes=np.array(row["force_nodes"]).reshape(N_FEET, stances, FORCE_PIECES + 1, 2, 3),
    )


def solution_columns(
    solution: Solution, verdict: Verdict, violations: Violations, expected_cost: float | None
) -> Row:
    """What the optimizer and the quality filter said of one solution, as columns."""
    return {
        "status": str(solution.status),
        "message": solution.message,
        "accepted": verdict.accepted,
        "reject_reasons": list(verdict.reasons),
        "cost": solution.cost,
        "expected_cost": expected_cost,
        "cost_terms": list(solution.cost_terms.items()),
        "constraint_violation": list(solution.constraint_violation.items()),
        "violations": list(violations.as_dict().items()),
        "iterations": solution.iterations,
        "solve_cpu_s": solution.solve_cpu_s,
        "liftoff_swaps": solution.liftoff_swaps,
        "saturated": list(solution.saturated),
        "gait_order": list(solution.order),
        "guess_footholds": solution.guess.footholds.ravel().tolist(),
        **trajectory_columns(solution.trajectory),
    }


def error_columns(message: str) -> Row:
    """Columns of a task whose work failed outside the optimizer; nothing was solved."""
    return {
        "status": "error",
        "message": message,
        "accepted": False,
        "reject_reasons": ["not_converged:error"],
        "cost_terms": [],
        "constraint_violation": [],
        "violations": [],
    }


def solution_note(row: Row) -> Row:
    """What is counted of a row of ``solutions`` while it is on its way."""
    return {
        "status": row["status"],
        "accepted": row["accepted"],
        "reasons": row["reject_reasons"],
        "solve_cpu_s": row.get("solve_cpu_s"),
    }


def now() -> datetime:
    """The present time, UTC."""
    return datetime.now(UTC)


def motion_columns(motion: Motion) -> Row:
    """A sampled motion as columns; times in s, everything else in SI units and world frame."""
    holds = motion.footholds
    return {
        "t": motion.times.tolist(),
        **{
            column: np.asarray(getattr(motion, name)).ravel().tolist()
            for column, name, _ in MOTION_COLUMNS
        },
        "foothold_foot": holds.foot.tolist(),
        "foothold_x": holds.position_W[:, 0].tolist(),
        "foothold_y": holds.position_W[:, 1].tolist(),
        "foothold_touchdown": holds.touchdown.tolist(),
        "foothold_liftoff": holds.liftoff.tolist(),
    }


def has_motion(row: Mapping[str, Any]) -> bool:
    """Whether the motion of a row of ``rollouts`` was kept."""
    return len(row["t"]) > 0


def motion_of(row: Mapping[str, Any]) -> Motion:
    """The motion of a row of ``rollouts``; see :func:`has_motion`."""
    count = len(row["t"])
    return Motion(
        times=np.array(row["t"]),
        **{
            name: np.array(row[column]).reshape(count, *shape)
            for column, name, shape in MOTION_COLUMNS
        },
        footholds=Footholds(
            foot=np.array(row["foothold_foot"], dtype=np.intp),
            position_W=np.stack([row["foothold_x"], row["foothold_y"]], axis=-1),
            touchdown=np.array(row["foothold_touchdown"]),
            liftoff=np.array(row["foothold_liftoff"]),
        ),
    )


def learning_history(history: tuple[EpochRecord, ...]) -> list[dict[str, float]]:
    """A training's epochs as flat records, for figures."""
    quantities = ("loss", "reconstruction", "kl")
    flat = []
    for record in history:
        row = {"epoch": float(record.epoch)}
        row |= {f"train_{name}": getattr(record, name) for name in quantities}
        if record.validation is not None:
            row |= {f"validation_{name}": getattr(record.validation, name) for name in quantities}
        flat.append(row)
    return flat


def summary_metrics(summary: ReplannerSummary) -> dict[str, float]:
    """A replanner's summary as named numbers in SI units; ``_low`` and ``_high`` bound 95 %."""
    performance = summary.performance
    metrics: dict[str, float] = {
        "rollouts": float(performance.motions),
        "diverged": float(summary.diverged),
        "obstacles_crossed": float(performance.obstacles_crossed),
        "linear_residual_p95": summary.linear_residual_p95,
        "angular_residual_p95": summary.angular_residual_p95,
        "velocity_jump": summary.velocity_jump,
        "foot_jump": summary.foot_jump,
        "disagreement_share": summary.disagreement_share,
        "plan_seconds": summary.plan_seconds,
    }
    for field in fields(performance):
        estimate = getattr(performance, field.name)
        if isinstance(estimate, Estimate):
            metrics[field.name] = estimate.value
            metrics[f"{field.name}_low"] = estimate.low
            metrics[f"{field.name}_high"] = estimate.high
    return metrics


def to_json(value: object) -> str:
    """Compact JSON with sorted keys."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"))


def obstacles_of(row: Mapping[str, Any]) -> Array:
    """The obstacle lines (n, 3) of a row of ``solutions`` or ``rollouts``, world frame."""
    return np.array(row["obstacles"], dtype=float).reshape(-1, 3)
