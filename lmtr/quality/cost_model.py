"""The cost to be expected of a task, so that hard tasks are not mistaken for bad solutions.

Cost grows with the task: with its mean speed above all, the faster the higher that is, and with
every line to cross. A plain threshold on it would remove hard tasks from the data. So the part that
the task explains is taken off first; what is left tells a poor local optimum from a good one.
"""

import numpy as np
from scipy.optimize import least_squares

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.geometry.se2 import SE2
from lmtr.robot.model import RobotModel
from lmtr.settings import NonNegative, Positive, Settings
from lmtr.task.task import Task

FEATURES = ("distance_fourth", "lateral", "yaw", "lines", "scatter")
"""What :func:`task_features` tells of a task, in this order."""

_ROWS_PER_COEFFICIENT = 5

_REFITS = 4
"""Outliers bend the first fit, and with it the typical residual; later fits see them as such."""

_INTERIOR = 1e-6
"""Fits start inside their bounds."""


class CostModel(Settings):
    """A cost linear in the features of a task; nothing that makes a task harder lowers it.

    Attributes:
        robot: Name of the robot that it was fitted for, for people.
        cost_key: Digest of the robot's figures and the expert's settings that it was fitted for,
            as those settings give it; nothing is expected of others.
        intercept: Cost of a task whose features are all zero.
        typical: Cost of a usual task. Costs of shorter ones spread as widely as its own, so their
            excess is measured by it too.
        distance_fourth: Per fourth power of a metre of the distance from start to goal.
        lateral: Per metre that the goal lies beside the start's x axis.
        yaw: Per radian that the goal is turned.
        lines: Per obstacle line.
        scatter: Per metre of root mean square offset of the start feet from neutral.
    """

    robot: str
    cost_key: str
    typical: Positive
    intercept: NonNegative
    distance_fourth: NonNegative
    lateral: NonNegative
    yaw: NonNegative
    lines: NonNegative
    scatter: NonNegative

    def predict(self, features: Array) -> Array:
        """Expected costs (...) of tasks with features (..., 5)."""
        slopes = np.array([getattr(self, name) for name in FEATURES])
        return np.asarray(self.intercept + features @ slopes)

    def excess(self, costs: Array, expected: Array) -> Array:
        """Costs (...) beyond the expected ones, as a share of these or of the typical cost."""
        return np.asarray((costs - expected) / np.maximum(expected, self.typical))


def task_features(task: Task, robot: RobotModel) -> Array:
    """What makes a task dear, (5,), in the order of ``FEATURES``: m⁴, m, rad, 1, m."""
    start = SE2.of(task.start_pose_W)
    goal = start.invert() @ SE2.of(task.goal_pose_W)
    scatter = task.start_feet_B() - robot.nominal_feet_B[:, :2]
    turn = np.arctan2(np.sin(goal.yaw), np.cos(goal.yaw))
    return np.array(
        [
            (goal.x**2 + goal.y**2) ** 2,
            np.abs(goal.y),
            np.abs(turn),
            len(task.obstacles_W),
            np.sqrt(np.mean(np.sum(scatter**2, axis=-1))),
        ]
    )


def fit_cost_model(features: Array, costs: Array, robot: str, cost_key: str) -> CostModel | None:
    """Fit the expectation to converged solves, with little regard to outliers.

    Residuals beyond the typical one count by their size instead of their square, so the poor
    solutions that the model is meant to find hardly bend it.

    Args:
        features: Of n tasks, (n, 5).
        costs: Of their solutions, (n,).
        robot: Name of the robot.
        cost_key: Digest of all that these costs depend on, as the expert's settings give it.

    Returns:
        The model; none if there are too few solves to fit six coefficients.

    Raises:
        DataError: Shapes do not match or numbers are not finite.
    """
    features, costs = np.asarray(features, dtype=float), np.asarray(costs, dtype=float)
    if features.shape != (len(costs), len(FEATURES)):
        raise DataError(
            f"cost model: features must have shape ({len(costs)}, {len(FEATURES)}) beside "
            f"{len(costs)} costs, got {features.shape}"
        )
    if not (np.isfinite(features).all() and np.isfinite(costs).all()):
        raise DataError("cost model: features and costs must be finite; fit converged solves only")
    design = np.concatenate([np.ones((len(costs), 1)), features], axis=-1)
    if len(costs) < _ROWS_PER_COEFFICIENT * design.shape[1]:
        return None
    fitted = np.maximum(np.linalg.lstsq(design, costs, rcond=None)[0], _INTERIOR)
    for _ in range(_REFITS):
        typical = 1.5 * np.median(np.abs(costs - design @ fitted)) + 1e-12
        fitted = least_squares(
            lambda w: design @ w - costs,
            np.maximum(fitted, _INTERIOR),
            lambda w: design,
            bounds=(0.0, np.inf),
            loss="soft_l1",
            f_scale=typical,
        ).x
    names = ("intercept", *FEATURES)
    return CostModel(
        robot=robot,
        cost_key=cost_key,
        typical=float(np.median(costs)),
        **dict(zip(names, fitted.tolist(), strict=True)),
    )


DEFAULT_COST_MODEL = CostModel(
    robot="anymal",
    cost_key="8371f2f29c89",
    typical=3.81,
    intercept=2.10,
    distance_fourth=0.0247,
    lateral=0.0343,
    yaw=0.0,
    lines=0.275,
    scatter=0.42,
)
"""Fitted by ``benchmarks/thresholds.py`` to the solutions of 300 default tasks and of 300 varied
ones, with 0 to 4 lines and goals 0.5 to 3.6 m away, by the expert's default settings.

Costs of one task, solved from several guesses, spread by 7 %; the means of tasks by 5 % around what
is expected of them. So the excess is the solution's more than the task's.
"""
