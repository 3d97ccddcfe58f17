"""The heuristic h(x̄, ξ̄) that starts the optimizer (Eq. 2; Sec. 4.2).

The base moves in a straight line from start to goal, with smooth noise on its SE(2) components;
the feet walk under it, beginning with the one furthest back; the forces share the weight.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import isotonic_regression

from lmtr.arrays import Array
from lmtr.expert.settings import Scope
from lmtr.geometry.rotation import wrap_angle
from lmtr.geometry.se2 import SE2
from lmtr.robot.model import N_FEET, RobotModel
from lmtr.spline.bspline import hermite_nodes
from lmtr.task.sampling import Noise, gait_order
from lmtr.task.task import Task
from lmtr.trajectory.nodes import HEIGHT, PLANAR, VALUE
from lmtr.trajectory.trajectory import BASE_STEP, FORCE_PIECES, Trajectory

STANDING_SHARE = 0.30
"""Share of the weight at every free force node: between a quarter (four feet) and a third."""

SWING_SPEED = 1.5
"""Horizontal velocity in mid-swing over the swing's mean; 1.5 is that of a single cubic."""

SHORTEST_SWING, SHORTEST_STANCE, SHORTEST_END = 0.8, 0.3, 0.7
"""Shortest swing, stance, and first or last stance in a noisy guess, as shares of nominal ones."""


@dataclass(frozen=True)
class InitialGuess:
    """A first guess τ̄₀.

    Attributes:
        control_points: Control points of the base's uniform cubic B-spline, knots every 0.1 s,
            (N + 2, 6): x, y, z (m), roll, pitch, yaw (rad). Three equal ones at an end rest.
        trajectory: The same guess in native nodes, world frame.
        order: Feet in the order in which they first swing.
    """

    control_points: Array
    trajectory: Trajectory
    order: tuple[int, int, int, int]


def initial_guess(task: Task, noise: Noise, robot: RobotModel, scope: Scope) -> InitialGuess:
    """Build τ̄₀ = h(x̄, ξ̄) in the world frame.

    Raises:
        TaskError: The noise was drawn for another scope.
    """
    noise.require_scope(scope.n_swings)
    order = gait_order(task, robot, noise.first)
    times = contact_times(scope, order, noise)
    feet = _footholds(task, noise, robot, scope, times)
    control = base_control_points(task, noise, robot, scope)
    trajectory = Trajectory(
        base_start=np.array(0.0),
        base_nodes=hermite_nodes(control, BASE_STEP),
        contact_times=times,
        footholds=feet,
        swing_nodes=_swing_nodes(feet, times, scope.clearance),
        force_nodes=_force_nodes(robot, scope),
    )
    return InitialGuess(control, trajectory, order)


def base_path(task: Task, noise: Noise, scope: Scope, times: Array) -> Array:
    """Guessed x, y (m) and yaw (rad) of the base at ``times`` (...) in s; (..., 3) (E35)."""
    phase = np.clip(times / scope.duration, 0.0, 1.0)
    change = task.goal_pose_W - task.start_pose_W
    change[2] = wrap_angle(change[2])
    return np.asarray(task.start_pose_W + phase[..., None] * change + noise.on_base(phase))


def base_control_points(task: Task, noise: Noise, robot: RobotModel, scope: Scope) -> Array:
    """B-spline control points (N + 2, 6) along the guessed path, at rest at both ends."""
    times = BASE_STEP * np.arange(-1, scope.n_nodes + 1)
    # The path is run through in the time between the resting knots at either end.
    spread = (times - BASE_STEP) * scope.duration / (scope.duration - 2.0 * BASE_STEP)
    planar = base_path(task, noise, scope, np.clip(spread, 0.0, scope.duration))
    control = np.zeros((scope.n_nodes + 2, 6))
    control[:, PLANAR] = planar
    control[:, HEIGHT] = robot.nominal_height
    return control


def contact_times(scope: Scope, order: tuple[int, ...], noise: Noise | None = None) -> Array:
    """Contact changes (4, 2·N̄_p + 2) in s of a walk in the given order of feet (E34).

    Slot i of the order lifts off for the j-th time at ``first_liftoff + cycle·(j + i/4)``.
    """
    swing, cycle = scope.nominal_swing, scope.nominal_cycle
    times = np.zeros((N_FEET, 2 * scope.n_stances))
    for slot, foot in enumerate(order):
        liftoff = scope.first_liftoff + cycle * (np.arange(scope.n_swings) + slot / N_FEET)
        events = np.stack([liftoff, liftoff + swing], axis=-1).reshape(-1)
        if noise is not None:
            events = _in_order(events + noise.timing[slot], scope)
        times[foot, 1:-1] = events
        times[foot, -1] = scope.duration
    return times


def _in_order(events: Array, scope: Scope) -> Array:
    """The contact changes (2·N̄_p) s of one foot nearest to noisy ones that keep phases apart.

    Noise must neither reorder a foot's events nor shrink a phase to nothing. Taking off the least
    time that must have passed before each event leaves times that must only ascend: an isotonic
    regression.
    """
    swing, stance = scope.nominal_swing, scope.nominal_cycle - scope.nominal_swing
    least = np.tile([SHORTEST_SWING * swing, SHORTEST_STANCE * stance], scope.n_swings)[:-1]
    passed = np.concatenate([[0.0], np.cumsum(least)])
    edge = SHORTEST_END * scope.first_liftoff
    ascending = isotonic_regression(events - passed).x
    return np.asarray(np.clip(ascending, edge, scope.duration - edge - passed[-1]) + passed)


def _footholds(task: Task, noise: Noise, robot: RobotModel, scope: Scope, times: Array) -> Array:
    """Footholds (4, S, 3) under the guessed base at mid-stance, ends at start and goal (E36)."""
    middle = 0.5 * (times[:, 0::2] + times[:, 1::2])
    pose = SE2.of(base_path(task, noise, scope, middle))
    neutral = np.repeat(robot.nominal_feet_B[:, None, :], scope.n_stances, axis=1)
    neutral[..., 2] = 0.0
    feet = pose.apply(neutral)
    feet[:, 0, :2] = task.start_feet_W
    feet[:, -1] = SE2.of(task.goal_pose_W).over(1).apply(neutral[:, -1])
    return feet


def _swing_nodes(feet: Array, times: Array, clearance: float) -> Array:
    """Middle of each swing (4, S − 1, 5): half-way, lifted, at 1.5 times the mean velocity."""
    duration = (times[:, 2::2] - times[:, 1:-1:2])[..., None]
    mean_velocity = (feet[:, 1:, :2] - feet[:, :-1, :2]) / duration
    middle = 0.5 * (feet[:, 1:, :2] + feet[:, :-1, :2])
    height = np.full((*middle.shape[:-1], 1), clearance)
    return np.concatenate([middle, height, SWING_SPEED * mean_velocity], axis=-1)


def _force_nodes(robot: RobotModel, scope: Scope) -> Array:
    """Force nodes (4, S, K + 1, 2, 3): a share of the weight away from swings (E36)."""
    nodes = np.zeros((N_FEET, scope.n_stances, FORCE_PIECES + 1, 2, 3))
    nodes[:, :, 1:-1, VALUE, 2] = STANDING_SHARE * robot.weight
    nodes[:, 0, 0, VALUE, 2] = STANDING_SHARE * robot.weight
    nodes[:, -1, -1, VALUE, 2] = STANDING_SHARE * robot.weight
    return nodes
