"""Pictures of one solution or one rollout: top view with gait diagram, and an animation."""

from pathlib import Path

from lmtr.errors import ConfigurationError, DataError
from lmtr.figures.animation import animate
from lmtr.figures.motion_figure import motion_figure
from lmtr.figures.style import save
from lmtr.trajectory.motion import Motion, sampled
from pipelines import records
from pipelines.datasets import configuration_of, resolve
from pipelines.progress import say
from pipelines.workspace import Workspace

FRAME_STEP_S = 1.0 / 15.0


def show_solution(
    workspace: Workspace, name: str, out: Path | None, *, animation_format: str | None
) -> list[Path]:
    """Draw a solution named INDEX (newest data set) or DATASET/INDEX; returns the files."""
    dataset_name, _, index = name.rpartition("/")
    if not (index.isascii() and index.isdecimal()):
        raise ConfigurationError(
            f"solution {name!r} must be an index such as 7, or DATASET/INDEX; see "
            '`lmtr query "SELECT dataset_id, index, status FROM solutions"`'
        )
    dataset_id = resolve(workspace, dataset_name or None)
    rows = workspace.lake.read(
        "solutions", where=f"dataset_id = '{dataset_id}' AND index = {index}"
    ).to_pylist()
    if not rows:
        raise DataError(
            f"solution {index} is not in data set {dataset_id!r}; extend that set with "
            f"`lmtr generate --solutions {int(index) + 1}` and the settings it was made with"
        )
    row = rows[0]
    if not row["base_nodes"]:
        raise DataError(
            f"solution {index} of {dataset_id!r} has no trajectory: {row['message']}; "
            "show another one"
        )
    motion = sampled(records.trajectory_of(row), FRAME_STEP_S)
    verdict = "accepted" if row["accepted"] else "rejected: " + ", ".join(row["reject_reasons"])
    title = f"Expert solution {index} of {dataset_id} ({row['status']}, {verdict})"
    stem = f"solution-{dataset_id}-{index}"
    return _draw(workspace, motion, row, title, stem, out, dataset_id, animation_format)


def show_rollout(
    workspace: Workspace, name: str, out: Path | None, *, animation_format: str | None
) -> list[Path]:
    """Draw a rollout by its id; returns the files."""
    quoted = name.replace("'", "''")
    rows = workspace.lake.read("rollouts", where=f"rollout_id = '{quoted}'").to_pylist()
    if not rows:
        raise DataError(
            f"rollout {name!r} is not in this home; see "
            '`lmtr query "SELECT rollout_id FROM rollouts"`'
        )
    row = rows[0]
    if not records.has_motion(row):
        raise DataError(
            f"rollout {name!r} was kept without its motion; those with one are "
            '`lmtr query "SELECT rollout_id FROM rollouts WHERE len(t) > 0"`, and '
            "evaluation.keep_motions says how many later evaluations keep"
        )
    motion = records.motion_of(row)
    title = f"Rollout {name}: {row['replanner']}, {row['outcome']}"
    return _draw(
        workspace,
        motion,
        row,
        title,
        f"rollout-{name}",
        out,
        row["dataset_id"],
        animation_format,
    )


def _draw(
    workspace: Workspace,
    motion: Motion,
    row: records.Row,
    title: str,
    stem: str,
    out: Path | None,
    dataset_id: str,
    animation_format: str | None,
) -> list[Path]:
    folder = out or workspace.home.reports / "shown"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(
            f"show: {folder} cannot be made a folder ({error.strerror}); name another --out"
        ) from error
    obstacles = records.obstacles_of(row)
    robot = configuration_of(workspace, dataset_id).dataset.robot
    picture = folder / f"{stem}.png"
    save(motion_figure(motion, obstacles, title), picture)
    paths = [picture]
    if animation_format is not None:
        say("Drawing the animation …")
        film = folder / f"{stem}.{animation_format}"
        animate(motion, obstacles, robot, film, title)
        paths.append(film)
    return paths
