"""The expert's optimization problem: a table of contents (Sec. 4.1–4.2).

    minimize    costs(x; p)
    subject to  dynamics, range of motion, phase durations, friction, bounds on x

Variables x are described in :mod:`lmtr.expert.variables`, parameters p in
:mod:`lmtr.expert.quantities`. One formulation serves every task, first foot, noise, set of
obstacles and set of weights; only robot, scope, limits and σ are built in.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lmtr.errors import TaskError
from lmtr.expert.assembly import Assembled, Assembly, Placed
from lmtr.expert.constraints.dynamics import dynamics
from lmtr.expert.constraints.friction import friction
from lmtr.expert.constraints.range_of_motion import range_of_motion
from lmtr.expert.constraints.timing import timing
from lmtr.expert.context import Context
from lmtr.expert.costs import costs
from lmtr.expert.element import ConstraintGroup
from lmtr.expert.initial_guess import InitialGuess
from lmtr.expert.layout import Index, Layout
from lmtr.expert.quantities import MAX_OBSTACLES, linear_map
from lmtr.expert.settings import ExpertSettings
from lmtr.expert.timing import Windows
from lmtr.expert.variables import variable_layout
from lmtr.robot.model import RobotModel
from lmtr.task.task import Task

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Formulation:
    """The problem of one robot and settings, ready to be compiled or solved.

    Attributes:
        variables: Layout of x.
        parameters: Layout of p.
        rows: Layout of the constraint rows, one block per group.
        lower, upper: Bounds of x.
        rows_lower, rows_upper: Bounds of the rows.
        windows: Earliest and latest contact changes, by slot.
        functions: Its functions and their derivatives.
    """

    variables: Layout
    parameters: Layout
    rows: Layout
    lower: Array
    upper: Array
    rows_lower: Array
    rows_upper: Array
    windows: Windows
    functions: Assembled


def formulate(robot: RobotModel, settings: ExpertSettings) -> Formulation:
    """Build the problem."""
    context = Context.of(robot, settings)
    groups = [dynamics(context), range_of_motion(context), timing(context), friction(context)]
    rows = Layout({group.name: group.lower.shape for group in groups})
    placed = [*_placed(groups, rows), *(Placed(element, 0) for element in costs(context))]
    assembly = Assembly(placed, linear_map(settings), rows.size, context.parameters.size)
    variables = variable_layout(settings.scope)
    lower, upper = _bounds(context, variables)
    return Formulation(
        variables=variables,
        parameters=context.parameters,
        rows=rows,
        lower=lower,
        upper=upper,
        rows_lower=np.concatenate([group.lower for group in groups]),
        rows_upper=np.concatenate([group.upper for group in groups]),
        windows=context.windows,
        functions=assembly.assemble(),
    )


def _placed(groups: list[ConstraintGroup], rows: Layout) -> list[Placed]:
    return [
        Placed(element, int(rows[group.name][0])) for group in groups for element in group.elements
    ]


def _bounds(context: Context, variables: Layout) -> tuple[Array, Array]:
    """Simple bounds; those on control points bound the whole splines (convex hull)."""
    settings, nominal_height = context.settings, context.robot.nominal_height
    limits, clearance = settings.limits, settings.scope.clearance
    lower, upper = np.full(variables.size, -np.inf), np.full(variables.size, np.inf)

    def bound(index: Index, low: Array | float, high: Array | float) -> None:
        lower[index], upper[index] = low, high

    control = variables["control"]
    bound(control[:, 2], nominal_height - limits.height, nominal_height + limits.height)
    bound(control[:, 3:5], -limits.tilt, limits.tilt)
    bound(variables["times"], context.windows.earliest[:, 1:-1], context.windows.latest[:, 1:-1])
    bound(variables["forces"][..., 2], 0.0, limits.force)
    low, high = limits.swing_height
    bound(variables["swing_offset"][..., 2], low - clearance, high - clearance)
    return lower, upper


def parameter_values(
    task: Task,
    guess: InitialGuess,
    robot: RobotModel,
    settings: ExpertSettings,
    parameters: Layout,
) -> Array:
    """The parameter vector of one task, with feet in the order of its guess.

    Raises:
        TaskError: There are more obstacles than the problem has room for.
    """
    if len(task.obstacles_W) > MAX_OBSTACLES:
        raise TaskError(
            f"task: obstacles_W has {len(task.obstacles_W)} lines, but the expert has room for "
            f"{MAX_OBSTACLES}; leave out those furthest from the path"
        )
    order = list(guess.order)
    lines = np.zeros((MAX_OBSTACLES, 4))
    for line, (x, y, alpha) in zip(lines, task.obstacles_W, strict=False):
        normal = np.array([-np.sin(alpha), np.cos(alpha)])
        line[:] = *normal, normal @ np.array([x, y]), settings.obstacle_weight
    blocks: dict[str, Array | float] = {
        "start": guess.control_points[0],
        "goal": guess.control_points[-1],
        "start_feet": task.start_feet_W[order],
        "nominal_feet": robot.nominal_feet_B[order, :2],
        "reference": guess.trajectory.base_nodes[:, 0, :2],
        "lines": lines,
        "proximal": settings.solver.proximal,
        **settings.costs.model_dump(),
    }
    return parameters.pack(blocks)
