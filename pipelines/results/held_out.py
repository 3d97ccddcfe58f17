"""Plans for the expert's own held-out tasks: what regression and the choice of a mode each cost.

A rollout mixes both with a third: it leads where the expert never was. Here tasks are the expert's,
so that what a replanner does worse in rollouts is due to where they led.
"""

from collections.abc import Mapping

import numpy as np

from lmtr.arrays import Array
from lmtr.geometry.line import signed_distance
from lmtr.models.trained import TrainedModel
from lmtr.policies.distance import TaskWeights
from lmtr.replanners.build import build_replanner
from lmtr.robot.model import RobotModel
from lmtr.vectors.layout import TASK_LAYOUT
from lmtr.vectors.segment_vector import decode_segment
from pipelines.learning_data import LearningData
from pipelines.results.blocks import Chapter, Row, Table

TASKS = 2000
"""Held-out tasks that are planned for, evenly among all."""


def held_out_chapter(
    models: Mapping[str, TrainedModel],
    data: LearningData,
    weights: TaskWeights,
    robot: RobotModel,
    close: float,
) -> Chapter:
    """Plans of each kind of replanner beside the expert's own segments.

    Args:
        models: By model id, one of each latent dimension.
        data: Segments to look up, and those held out.
        weights: w of the look-up.
        robot: The robot.
        close: Distance below which a foothold is close to a line (m).
    """
    every = len(data.validation.x)
    rows = np.linspace(0, every - 1, min(TASKS, every)).round().astype(np.intp)
    x, tau = data.validation.x[rows], data.validation.tau[rows]
    plans: list[tuple[str, Array, list[str]]] = [("expert", tau, [])]
    for model_id, model in models.items():
        name = model.settings.name
        if model.latent:
            plans.append(
                (f"{name}, own mode", model.predict(x, model.encode(tau, x)[0]), [model_id])
            )
            name = f"{name}, π_nbr"
        plan = build_replanner(model, data.training, weights, robot=robot).plan(x)
        plans.append((name, plan, [model_id]))
    plans.append(("library", build_replanner(None, data.training, weights).plan(x), []))
    table = Table(
        "held-out",
        f"Plans for {len(rows):,} tasks of solutions that no model learnt from, at the w that is "
        "reported. With its *own mode* a model is told by the encoder how the expert solved the "
        "task; π_nbr takes the mode of the nearest task. Shares are of next footholds, not of "
        "pairs of line and foot as in rollouts.",
        [
            "plan",
            f"next footholds within {100 * close:g} cm of a line (%)",
            "median distance of next footholds from the expert's (mm)",
        ],
        [
            Row([name, 100.0 * close_share(plan, x, close), 1e3 * _apart(plan, tau)], ids)
            for name, plan, ids in plans
        ],
    )
    return Chapter("Plans for held-out tasks", [table])


def close_share(plans: Array, tasks: Array, close: float) -> float:
    """Share of next footholds of plans (B, 264) that are close to a line of their tasks (B, 35)."""
    lines = TASK_LAYOUT.unpack(tasks)["next_lines"]  # (B, 2, 3)
    apart = np.abs(signed_distance(lines[:, None], _next_footholds(plans)[:, :, None]))
    return float((apart.min(axis=-1) < close).mean())


def _apart(plans: Array, expert: Array) -> float:
    """Median distance of next footholds (m)."""
    offsets = _next_footholds(plans) - _next_footholds(expert)
    return float(np.median(np.linalg.norm(offsets, axis=-1)))


def _next_footholds(plans: Array) -> Array:
    """Where each foot lands next, (B, 4, 2) in m, _S."""
    return np.asarray(decode_segment(plans).footholds[:, :, 1, :2])
