"""Films of the report: an expert solution, and the replanner with modes at work."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lmtr.arrays import Array
from lmtr.figures.animation import AnimationSettings, animate
from lmtr.figures.resample import resampled
from lmtr.robot.model import RobotModel
from lmtr.trajectory.motion import Motion, sampled
from pipelines import records
from pipelines.report.page import Picture
from pipelines.report.results import Evaluation

SETTINGS = AnimationSettings(fps=12, resolution=90)

LENGTH_S = 8.0
"""Films show so much of a motion at most."""


def films(
    rows: Sequence[records.Row], tried: Sequence[Evaluation], robot: RobotModel, folder: Path
) -> list[Picture]:
    """Draw the first accepted solution and a rollout of the last LMTR, where there are such.

    Args:
        rows: Rows of ``solutions``.
        tried: Evaluations, in the order of the report.
        robot: The robot that moves.
        folder: Where the films are written.
    """
    made = []
    good = next((row for row in rows if row["accepted"]), None)
    if good is not None:
        motion = sampled(records.trajectory_of(good), 1.0 / SETTINGS.fps)
        title = f"Expert solution {good['index']}"
        made.append(_film("film-expert", title, motion, records.obstacles_of(good), robot, folder))
    latent = [each for each in tried if each.label.startswith("LMTR")]
    if latent and len(latent[-1].example["t"]) > 1:
        row = latent[-1].example
        title = f"{latent[-1].label}, course {row['index']}"
        motion, lines = records.motion_of(row), records.obstacles_of(row)
        made.append(_film("film-lmtr", title, motion, lines, robot, folder))
    return made


def _film(
    name: str,
    title: str,
    motion: Motion,
    obstacles_W: Array,
    robot: RobotModel,
    folder: Path,
) -> Picture:
    end = min(float(motion.times[-1]), float(motion.times[0]) + LENGTH_S)
    times = np.arange(float(motion.times[0]), end, 1.0 / SETTINGS.fps)
    path = animate(
        resampled(motion, times), obstacles_W, robot, folder / f"{name}.gif", title, SETTINGS
    )
    return Picture(
        name,
        path,
        f"{title}: ground reactions (red), friction pyramids, ranges of motion (blue boxes), "
        "footholds (crosses), obstacle lines (grey).",
        f"Film of {title}.",
    )
