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

from lmtr.expert.assembly import Assembled, Assembly, Placed
from lmtr.expert.constraints.dynamics import dynamics
from lmtr.expert.constraints.friction import friction
from lmtr.expert.constraints.range_of_motion import range_of_motion
from lmtr.expert.constraints.timing import timing
from lmtr.expert.costs import costs
from lmtr.expert.element import ConstraintGroup
from lmtr.expert.initial_guess import InitialGuess
from lmtr.expert.layout import Layout
from lmtr.expert.quantities import (
    MAX_OBSTACLES,
    linear_map,
    parameter_layout,
    quantity_layout,
)
from lmtr.expert.settings import ExpertSettings
from lmtr.expert.timing import Windows, windows
from lmtr.expert.variables import variable_layout
from lmtr.robot.model import RobotModel
from lmtr.task.task import Task
from lmtr.trajectory.trajectory import BASE_STEP

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
    quantities, parameters = quantity_layout(settings), parameter_layout(settings)
    timing_windows = windows(settings)
    variables = variable_layout(settings.scope)
    groups = [
        dynamics(robot, settings, timing_windows, quantities, parameters),
        range_of_motion(robot, settings, timing_windows, quantities, parameters),
        timing(settings, quantities),
        friction(robot, quantities),
    ]
    rows = Layout({group.name: group.lower.shape for group in groups})
    placed = _placed(groups, rows)
    placed += [Placed(element, 0) for element in costs(robot, settings, quantities, parameters)]
    assembly = Assembly(placed, linear_map(settings), rows.size, parameters.size)
    lower, upper = _bounds(robot, settings, timing_windows, variables)
    return Formulation(
        variables=variables,
        parameters=parameters,
        rows=rows,
        lower=lower,
        upper=upper,
        rows_lower=np.concatenate([group.lower for group in groups]),
        rows_upper=np.concatenate([group.upper for group in groups]),
        windows=timing_windows,
        functions=assembly.assemble(),
    )


def _placed(groups: list[ConstraintGroup], rows: Layout) -> list[Placed]:
    return [
        Placed(element, int(rows[group.name][0])) for group in groups for element in group.elements
    ]


def _bounds(
    robot: RobotModel, settings: ExpertSettings, timing_windows: Windows, variables: Layout
) -> tuple[Array, Array]:
    """Simple bounds; those on control points bound the whole splines (convex hull)."""
    limits = settings.limits
    control_low = np.full(variables["control"].shape, -np.inf)
    control_low[:, 2] = robot.nominal_height - limits.height
    control_low[:, 3:5] = -limits.tilt
    control_high = -control_low
    control_high[:, 2] = robot.nominal_height + limits.height
    force_low = np.full(variables["forces"].shape, -np.inf)
    force_low[..., 2] = 0.0
    force_high = np.full(variables["forces"].shape, np.inf)
    force_high[..., 2] = limits.force
    offset_low = np.full(variables["swing_offset"].shape, -np.inf)
    offset_low[..., 2] = limits.swing_height[0] - settings.scope.clearance
    offset_high = np.full(variables["swing_offset"].shape, np.inf)
    offset_high[..., 2] = limits.swing_height[1] - settings.scope.clearance
    low = {
        "control": control_low,
        "times": timing_windows.earliest[:, 1:-1],
        "footholds": -np.inf,
        "swing_offset": offset_low,
        "swing_drift": -np.inf,
        "forces": force_low,
    }
    high = {
        "control": control_high,
        "times": timing_windows.latest[:, 1:-1],
        "footholds": np.inf,
        "swing_offset": offset_high,
        "swing_drift": np.inf,
        "forces": force_high,
    }
    return variables.pack(low), variables.pack(high)


def parameter_values(
    task: Task,
    guess: InitialGuess,
    robot: RobotModel,
    settings: ExpertSettings,
    parameters: Layout,
) -> Array:
    """The parameter vector of one task, with feet in the order of its guess."""
    order = list(guess.order)
    lines = np.zeros((MAX_OBSTACLES, 4))
    for line, (x, y, alpha) in zip(lines, task.obstacles_W, strict=False):
        normal = np.array([-np.sin(alpha), np.cos(alpha)])
        line[:] = *normal, normal @ np.array([x, y]), settings.obstacle_weight
    return parameters.pack(
        {
            "start": guess.control_points[0],
            "goal": guess.control_points[-1],
            "start_feet": task.start_feet_W[order],
            "nominal_feet": robot.nominal_feet_B[order, :2],
            "reference": guess.trajectory.base_nodes[:, 0, :2],
            "lines": lines,
            "proximal": settings.solver.proximal,
            **settings.costs.model_dump(),
        }
    )
