"""The report on rollouts: one of each replanner (Fig. 3), snapshots (Fig. 5) and films."""

from collections.abc import Sequence

import numpy as np

from lmtr.figures.motion_figure import motion_figure
from lmtr.figures.snapshots import snapshots
from lmtr.robot.model import RobotModel
from lmtr.rollout.record import Ending
from pipelines import records
from pipelines.report.page import Picture, Section, Table, Text
from pipelines.report.results import Evaluation

SNAPSHOT_SPAN_S = 3.0
"""Snapshots are taken over so much of a rollout."""


def rollout_section(
    evaluations: Sequence[Evaluation], robot: RobotModel, films: Sequence[Picture]
) -> Section:
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
        end = f"{row['duration_s']:.1f} s, {row['distance_m']:.1f} m."
        if row["outcome"] == "diverged":
            end += f" It diverged: {Ending(row['reason']).describe()}"
        blocks.append(
            Picture(
                f"rollout-{number}",
                motion_figure(
                    records.motion_of(row),
                    records.obstacles_of(row),
                    f"{evaluation.label}: course {row['index']}",
                ),
                f"{evaluation.label}: {end} Dots: base every 0.1 s; crosses: footholds; grey: "
                "obstacle lines. Bars: stance; white boxes: swing.",
                f"Top view and gait diagram of a rollout of {evaluation.label}.",
            )
        )
    return Section("Rollouts", [*blocks, *_snapshots(evaluations, robot), *films])


def _snapshots(evaluations: Sequence[Evaluation], robot: RobotModel) -> list[Picture]:
    """Moments of the last LMTR's rollout (Fig. 5)."""
    latent = [e for e in evaluations if e.label.startswith("LMTR") and len(e.example["t"]) > 1]
    if not latent:
        return []
    row = latent[-1].example
    motion, start = records.motion_of(row), row["t"][0]
    times = start + np.linspace(0.1, 0.9, 6) * min(row["duration_s"] - start, SNAPSHOT_SPAN_S)
    title = f"{latent[-1].label}, course {row['index']}"
    return [
        Picture(
            "snapshots",
            snapshots(motion, records.obstacles_of(row), robot, times, title),
            f"Snapshots of a rollout of {latent[-1].label}: ranges of motion of the expert (blue "
            "boxes), friction pyramids and planned contact forces (red).",
            f"Six snapshots of a rollout of {latent[-1].label}.",
        )
    ]
