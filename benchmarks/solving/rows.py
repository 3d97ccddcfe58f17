"""A solve as a row of figures, measured with this checkout's measures whoever solved it."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.solving.worker import Reply
from lmtr.errors import LmtrError
from lmtr.quality.filter import expected_cost, judge
from lmtr.quality.measure import measure
from lmtr.quality.status import Status
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import Noise, sample_noise, sample_task
from lmtr.task.task import Task
from lmtr.trajectory.trajectory import Trajectory
from pipelines.config import Configuration

Row = dict[str, Any]
"""Figures of one solve, in SI units and forces in weights, by name."""


def draw_tasks(config: Configuration, seed: int, count: int) -> list[tuple[Task, Noise]]:
    """The first tasks of a data set with this configuration and seed, and their noise."""
    drawn = []
    for index in range(count):
        rng = stream(seed, Purpose.TASK, index)
        task = sample_task(config.tasks, config.dataset.robot, rng)
        drawn.append((task, sample_noise(config.tasks, config.expert.scope.n_swings, rng)))
    return drawn


def solve_row(index: int, task: Task, reply: Reply, config: Configuration, cost_key: str) -> Row:
    """Time, outcome, measures and verdict of one solve.

    Args:
        index: The task's index.
        task: The task.
        reply: What the worker replied.
        config: Robot and quality thresholds by which it is measured.
        cost_key: Digest of the costs that it was solved with.
    """
    row = {key: value for key, value in reply.items() if key != "trajectory"}
    row |= {"index": index, "converged": reply["status"] == Status.CONVERGED}
    robot, quality = config.dataset.robot, config.quality
    try:
        trajectory = Trajectory(**reply["trajectory"])
        found = measure(trajectory, robot, task.obstacles_W)
    except (TypeError, LmtrError) as error:
        # Another checkout may have another kind of trajectory; its times still count.
        return row | {"unmeasured": str(error)}
    expected = expected_cost(task, robot, cost_key, quality)
    verdict = judge(reply["status"], reply["cost"], expected, found, quality, reply["saturated"])
    return row | {
        **found.as_dict(),
        "expected_cost": expected,
        "closest_foothold": min(found.closest_footholds, default=np.nan),
        "accepted": verdict.accepted,
        "reasons": list(verdict.reasons),
    }


def count_reasons(rows: Sequence[Row]) -> dict[str, tuple[int, int]]:
    """For each reason, the solves refused for it and those refused for it alone, most first."""
    counts: dict[str, tuple[int, int]] = {}
    for row in rows:
        reasons = row.get("reasons", ())
        for reason in reasons:
            solves, alone = counts.get(reason, (0, 0))
            counts[reason] = (solves + 1, alone + (len(reasons) == 1))
    return dict(sorted(counts.items(), key=lambda item: item[1], reverse=True))
