"""Rollouts to look at: Fig. 3, Fig. 5, and a film of each replanner."""

from pathlib import Path

import numpy as np

from lmtr.figures.animation import AnimationSettings, animate
from lmtr.figures.motion_figure import motion_figure
from lmtr.figures.resample import resampled
from lmtr.figures.snapshots import snapshots
from lmtr.robot.model import RobotModel
from lmtr.rollout.record import Ending
from lmtr.trajectory.motion import Motion
from pipelines import records
from pipelines.progress import bar
from pipelines.results.blocks import Block, Chapter, Illustration, Missing
from pipelines.results.groups import Group, Groups, example
from pipelines.workspace import Workspace

SPAN_S = 3.0
"""Snapshots are taken over so much of a rollout."""

FILM_S = 10.0
"""Films show so much of a rollout at most."""

FILM = AnimationSettings(fps=12, resolution=90)


def rollout_chapter(workspace: Workspace, groups: Groups, robot: RobotModel) -> Chapter:
    """Fig. 3 of each kind of replanner on the same course, and Fig. 5."""
    blocks: list[Block] = []
    index: int | None = None
    for number, group in enumerate(_shown(groups)):
        row = example(workspace, group, index) or example(workspace, group)
        if row is None:
            blocks.append(Missing(f"No motion of {group.name} was kept."))
            continue
        index = row["index"] if index is None else index
        blocks.append(_rollout(group, row, number))
    latent = _closest_to_six(groups)
    row = None if latent is None else example(workspace, latent)
    if latent is not None and row is not None:
        blocks.append(_snapshots(latent, row, robot))
    else:
        blocks.append(Missing("No motion of an LMTR was kept, so there are no snapshots."))
    return Chapter("Rollouts", blocks)


def write_films(
    workspace: Workspace, groups: Groups, robot: RobotModel, folder: Path
) -> list[Path]:
    """Films of the same replanners on the same course; returns their paths."""
    shown, made = _shown(groups), []
    index: int | None = None
    with bar("Drawing films", len(shown)) as progress:
        for group in shown:
            row = example(workspace, group, index) or example(workspace, group)
            if row is not None:
                index = row["index"] if index is None else index
                path = folder / f"{_slug(group)}.gif"
                title = f"{group.name}, course {row['index']}"
                motion = _beginning(records.motion_of(row), FILM_S)
                made.append(animate(motion, records.obstacles_of(row), robot, path, title, FILM))
            progress.advance(note=group.name)
    return made


def _shown(groups: Groups) -> list[Group]:
    """Unimodal, an LMTR, the library; the latter two also with selection."""
    latent = _closest_to_six(groups)
    of_model = [] if latent is None else [latent, groups.get(latent.latent, "selected")]
    kinds = [groups.get(0), *of_model, groups.get(None), groups.get(None, "selected")]
    return [group for group in kinds if group is not None]


def _closest_to_six(groups: Groups) -> Group | None:
    """The plain LMTR whose n is closest to that of the paper's Fig. 5."""
    plain = [g for g in groups.shown if g.latent and g.policy == "nearest"]
    return min(plain, key=lambda g: abs((g.latent or 0) - 6), default=None)


def _slug(group: Group) -> str:
    return group.name.lower().replace(", ", "-").replace(" ", "-")


def _rollout(group: Group, row: records.Row, number: int) -> Illustration:
    end = f"{row['duration_s']:.1f} s, {row['distance_m']:.1f} m."
    if row["outcome"] == "diverged":
        end += f" It diverged: {Ending(row['reason']).describe()}"
    title = f"({chr(ord('a') + number)}) {group.name}, course {row['index']}"
    return Illustration(
        f"rollout-{_slug(group)}",
        motion_figure(records.motion_of(row), records.obstacles_of(row), title),
        f"Fig. 3. {group.name}: {end} Dots: base every 0.1 s; crosses: footholds; grey: obstacle "
        "lines. Bars: stance; white boxes: swing.",
    )


def _snapshots(group: Group, row: records.Row, robot: RobotModel) -> Illustration:
    motion, start = records.motion_of(row), row["t"][0]
    times = start + np.linspace(0.1, 0.9, 6) * min(row["duration_s"] - start, SPAN_S)
    title = f"{group.name}, course {row['index']}"
    return Illustration(
        "snapshots",
        snapshots(motion, records.obstacles_of(row), robot, times, title),
        f"Fig. 5. Snapshots of a rollout of {group.name}: the expert's range of motion (blue "
        "boxes), friction pyramids and planned contact forces (red).",
    )


def _beginning(motion: Motion, length: float) -> Motion:
    """The first ``length`` seconds of a motion at the rate of films."""
    first = float(motion.times[0])
    end = min(float(motion.times[-1]), first + length)
    return resampled(motion, np.arange(first, end, 1.0 / FILM.fps))
