"""What the lake says of replanners and of the expert, in the form that the report compares."""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.robot.model import RobotModel
from lmtr.rollout.metrics import forward_violation, obstacle_clearances
from lmtr.rollout.settings import Criteria
from lmtr.rollout.summary import performance
from lmtr.trajectory.motion import sampled
from pipelines import records
from pipelines.workspace import Workspace

EXPERT = "expert"
"""Label of the line of reference."""

SAMPLE_STEP_S = 0.1
"""Spacing at which Sec. 5.2 judges the range of motion."""


@dataclass(frozen=True)
class Evaluation:
    """Everything that is compared of one replanner, or of the expert.

    Attributes:
        label: What tables and figures call it.
        summary: Named figures, SI units.
        clearances: Closest foothold of each foot to each line crossed, pooled (m).
        violations: Forward violation of each contacting foot in each sample, pooled (m).
        criteria: What they were judged by.
        example: A row of ``rollouts`` to show: the first that reached its end, or the first; empty
            for the expert.
        evaluation_id: Its identity; empty for the expert.
        weights: w of its look-ups; empty for the expert.
        seed: Seed of the courses; None for the expert.
        settings: The testbed as recorded; empty for the expert.
        planner: The replanner's own description; empty for the expert.
    """

    label: str
    summary: dict[str, float]
    clearances: Array
    violations: Array
    criteria: Criteria
    example: records.Row = field(default_factory=dict)
    evaluation_id: str = ""
    weights: tuple[float, ...] = ()
    seed: int | None = None
    settings: dict[str, Any] = field(default_factory=dict)
    planner: dict[str, Any] = field(default_factory=dict)


def evaluations(workspace: Workspace, ids: Sequence[str]) -> list[Evaluation]:
    """Read evaluations in the order of their ids.

    Raises:
        DataError: One of them has not been made.
    """
    lake = workspace.lake
    made: list[Evaluation] = []
    for evaluation_id in ids:
        where = f"evaluation_id = '{evaluation_id}'"
        rows = lake.read("evaluations", where=where).to_pylist()
        if not rows:
            raise DataError(
                f"report: evaluation {evaluation_id} is not there; run `lmtr evaluate` with the "
                "same configuration first"
            )
        pooled = lake.read("rollouts", ["clearances", "violations"], where=where, order_by="index")
        first = lake.read(
            "rollouts", where=where, order_by="outcome = 'diverged', index", limit=1
        ).to_pylist()
        settings = json.loads(rows[0]["settings"])
        made.append(
            Evaluation(
                label=rows[0]["replanner"],
                evaluation_id=evaluation_id,
                weights=tuple(rows[0]["weights"]),
                summary=dict(rows[0]["summary"]),
                clearances=_pool(pooled["clearances"].to_pylist()),
                violations=_pool(pooled["violations"].to_pylist()),
                criteria=Criteria.model_validate(settings["criteria"]),
                example=first[0],
                seed=rows[0]["seed"],
                settings=settings,
                planner=json.loads(rows[0]["planner"]),
            )
        )
    return _told_apart(made)


def _told_apart(made: list[Evaluation]) -> list[Evaluation]:
    """The same with labels that differ: by weights first, by identity where that is not enough."""
    for label in (_with_weights, _with_identity):
        counts = Counter(each.label for each in made)
        made = [
            replace(each, label=label(each)) if counts[each.label] > 1 else each for each in made
        ]
    return made


def _with_weights(each: Evaluation) -> str:
    return f"{each.label} w={','.join(f'{value:g}' for value in each.weights)}"


def _with_identity(each: Evaluation) -> str:
    return f"{each.label} ({each.evaluation_id.rsplit('-', 1)[-1]})"


def expert_reference(
    rows: Sequence[records.Row], robot: RobotModel, criteria: Criteria
) -> Evaluation:
    """The accepted solutions, judged as rollouts are, on the tasks they were made for."""
    motions = [
        (sampled(records.trajectory_of(row), SAMPLE_STEP_S), records.obstacles_of(row))
        for row in rows
        if row["accepted"]
    ]
    found = performance(motions, robot, criteria)
    violations = [
        forward_violation(motion, robot, criteria.forward_limit)[motion.contact]
        for motion, _ in motions
    ]
    return Evaluation(
        label=EXPERT,
        summary={
            "rollouts": float(found.motions),
            "obstacles_crossed": float(found.obstacles_crossed),
            "close_share": found.close_share.value,
            "mean_violation": found.mean_violation.value,
            "large_violation_share": found.large_violation_share.value,
            "distance": found.distance.value,
        },
        clearances=_pool([obstacle_clearances(m, lines).ravel() for m, lines in motions]),
        violations=_pool(violations),
        criteria=criteria,
    )


def _pool(lists: Sequence[Sequence[float] | Array]) -> Array:
    arrays = [np.asarray(values, dtype=float) for values in lists]
    return np.concatenate(arrays) if arrays else np.zeros(0)
