"""Limits of the problem that a solution lies on.

Friction, range of motion, pushing feet and the shortest phases are the robot's: solutions lie on
them as they should (half of all swings take no longer than they must, since feet on the ground
share the load). The other limits only fence the problem in; a solution that leans on one of them
is shaped by an arbitrary number.

Judged are the variables of the solver and not the motion that they describe: limits hold for
control points of the base and Bézier points of the forces (E20, E21), and the curves between these
stay well inside of limits that the points lie on.
"""

import numpy as np
from numpy.typing import NDArray

from lmtr.arrays import Array, Indices
from lmtr.expert.formulation import Formulation
from lmtr.expert.settings import Limits
from lmtr.quality.limits import Limit
from lmtr.robot.model import N_FEET
from lmtr.trajectory.nodes import HEIGHT, TILT

NEARNESS = 0.01
"""Distance to a limit, as a share of the room between the lower and the upper one, at which a
solution lies on it. An interior point stops short of limits: solutions of walks with tightened
limits stopped within 0.006 of those that shaped them."""

Flags = NDArray[np.bool_]


def saturated(x: Array, problem: Formulation, limits: Limits) -> tuple[Limit, ...]:
    """Names of the limits that a solution lies on.

    Args:
        x: The solution.
        problem: Its problem.
        limits: The problem's limits.
    """
    variables, times = problem.variables, problem.variables["times"]
    control = variables["control"]
    lifted = variables["swing_offset"][..., 2]
    at_lower, at_upper = _lies_on(x, problem.lower, problem.upper)
    longest_swing, longest_stance = _longest(x[times], problem)

    def at_either(index: Indices) -> Flags:
        return at_lower[index] | at_upper[index]

    touched = {
        Limit.HEIGHT: at_either(control[:, HEIGHT]),
        Limit.TILT: at_either(control[:, TILT]),
        Limit.FORCE: at_upper[variables["forces"][..., 2]],
        Limit.SWING_HEIGHT: at_either(lifted),
        Limit.LONGEST_SWING: longest_swing,
        Limit.LONGEST_STANCE: longest_stance,
        Limit.WINDOW: _at_window(x[times], problem.windows.nominal[:, 1:-1], limits.window),
    }
    return tuple(limit for limit, touches in touched.items() if touches.any())


def _lies_on(value: Array, lower: Array, upper: Array) -> tuple[Flags, Flags]:
    """Whether values lie on their lower and on their upper bounds."""
    near = NEARNESS * (upper - lower)
    return value - lower < near, upper - value < near


def _longest(times: Array, problem: Formulation) -> tuple[Flags, Flags]:
    """Which swings, and which stances between two of them, last as long as they may (E19)."""
    rows = problem.rows["timing"].reshape(N_FEET, -1)
    durations = np.diff(times, axis=-1)
    _, longest = _lies_on(durations, problem.rows_lower[rows], problem.rows_upper[rows])
    return longest[:, 0::2], longest[:, 1::2]


def _at_window(times: Array, nominal: Array, window: float) -> Flags:
    """Which contact changes touch their window (E10).

    Where it is cut lest first and last stances get too short, that bound is the robot's.
    """
    at_earliest, at_latest = _lies_on(times, nominal - window, nominal + window)
    return at_earliest | at_latest
