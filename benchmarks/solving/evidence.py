"""One way from a task to a solve that can be judged: solve, measure, keep; then judge.

What the filter judges is kept without its verdict, so that solves outlive a change of thresholds.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from lmtr.expert.solve import Expert, Solution
from lmtr.quality.filter import QualityThresholds, expected_cost, judge
from lmtr.quality.measure import Violations, measure
from lmtr.quality.status import Status
from lmtr.robot.model import RobotModel
from lmtr.task.sampling import Noise
from lmtr.task.task import Task


@dataclass(frozen=True)
class Evidence:
    """What the quality filter judges of a solve.

    Attributes:
        task: The task.
        status: Outcome.
        cost: Cost.
        saturated: Limits that the solution lies on.
        figures: Its violations by name.
    """

    task: Task
    status: str
    cost: float
    saturated: tuple[str, ...]
    figures: dict[str, float]

    @property
    def converged(self) -> bool:
        """Whether the solver converged."""
        return self.status == Status.CONVERGED

    def reasons(
        self, robot: RobotModel, cost_key: str, thresholds: QualityThresholds
    ) -> tuple[str, ...]:
        """Why the filter refuses it, empty if it is accepted.

        Args:
            robot: The robot.
            cost_key: Digest of what its cost depends on.
            thresholds: What it may show.
        """
        expected = expected_cost(self.task, robot, cost_key, thresholds)
        found = Violations.from_dict(self.figures)
        verdict = judge(self.status, self.cost, expected, found, thresholds, self.saturated)
        return verdict.reasons

    def as_row(self) -> dict[str, Any]:
        """The same in plain values."""
        task = {name: np.asarray(value).tolist() for name, value in asdict(self.task).items()}
        return {
            "task": task,
            "status": self.status,
            "cost": self.cost,
            "saturated": list(self.saturated),
            "figures": self.figures,
        }

    @classmethod
    def from_row(cls, row: Mapping[str, Any]) -> "Evidence":
        """What :meth:`as_row` gave."""
        task = {name: np.array(value) for name, value in row["task"].items()}
        task["obstacles_W"] = task["obstacles_W"].reshape(-1, 3)
        return cls(
            task=Task(**task),
            status=row["status"],
            cost=row["cost"],
            saturated=tuple(row["saturated"]),
            figures=row["figures"],
        )


def solve(expert: Expert, task: Task, noise: Noise) -> tuple[Solution, Evidence]:
    """Solve a task and measure what comes of it."""
    solution = expert.solve(task, noise)
    found = measure(solution.trajectory, expert.robot, task.obstacles_W)
    return solution, Evidence(
        task=task,
        status=str(solution.status),
        cost=solution.cost,
        saturated=tuple(str(limit) for limit in solution.saturated),
        figures=found.as_dict(),
    )
