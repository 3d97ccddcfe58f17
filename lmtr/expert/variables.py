"""Decision variables x (E2): their blocks, and the way to and from a trajectory.

Feet are numbered here by *slot*, the order in which they first swing, so that one problem serves
every first foot. Quantities are chosen so that constraints become linear where they can:

* the base is given by the control points of a uniform cubic B-spline (E3), hence C²; the three
  at either end are equal (a static end) and no variables;
* contact changes are absolute times, so a force depends on two of them only;
* a stance force is given by the Bézier control points of its two cubics (E4), in weights:
  whatever convex bound these keep is kept at all times;
* the middle of a swing is an offset from the point half-way, and its velocity is multiplied by
  the swing's duration, so that positions in a swing are linear in them (E5).
"""

import numpy as np

from lmtr.arrays import Array
from lmtr.expert.blocks import Blocks
from lmtr.expert.initial_guess import SWING_SPEED, InitialGuess
from lmtr.expert.settings import Scope
from lmtr.expert.stances import END_FORCE_POINTS, MIDDLE_FORCE_POINTS, n_force_points
from lmtr.robot.model import N_FEET, RobotModel
from lmtr.spline.bspline import hermite_nodes
from lmtr.trajectory.nodes import SWING_POSITION, SWING_VELOCITY
from lmtr.trajectory.trajectory import BASE_STEP, FORCE_PIECES, Trajectory

END_POINTS = 3
"""Equal control points at either end of the base spline: a knot at rest."""

BEZIER_DEGREE = 3


def variable_blocks(scope: Scope) -> Blocks:
    """Blocks of the decision vector (E2).

    control: B-spline points x, y, z (m), roll, pitch, yaw (rad) between the fixed ends.
    times: Lift-off and touch-down of each swing (s), by slot.
    footholds: x, y of every stance but the given first one (m), by slot.
    swing_offset: Middle of a swing from the point half-way between its footholds, raised by the
        clearance (m), by slot.
    swing_drift: Mid-swing velocity times the swing's duration, beyond that of a straight step
        (m), by slot.
    forces: Bézier control points of the stance forces (weights), by slot, see
        :mod:`lmtr.expert.stances`.
    """
    return Blocks(
        {
            "control": (scope.n_nodes + 2 - 2 * END_POINTS, 6),
            "times": (N_FEET, 2 * scope.n_swings),
            "footholds": (N_FEET, scope.n_swings, 2),
            "swing_offset": (N_FEET, scope.n_swings, 3),
            "swing_drift": (N_FEET, scope.n_swings, 2),
            "forces": (N_FEET, n_force_points(scope.n_stances), 3),
        }
    )


def pack(guess: InitialGuess, robot: RobotModel, scope: Scope) -> Array:
    """The decision vector of an initial guess."""
    order = list(guess.order)
    trajectory = guess.trajectory
    feet = trajectory.footholds[order]
    swing = trajectory.swing_nodes[order]
    times = trajectory.contact_times[order]
    duration = (times[:, 2::2] - times[:, 1:-1:2])[..., None]
    return variable_blocks(scope).pack(
        {
            "control": guess.control_points[END_POINTS:-END_POINTS],
            "times": times[:, 1:-1],
            "footholds": feet[:, 1:, :2],
            "swing_offset": swing[..., SWING_POSITION] - _swing_middle(feet, scope),
            "swing_drift": swing[..., SWING_VELOCITY] * duration - _straight_drift(feet),
            "forces": _bezier_points(trajectory.force_nodes[order], times) / robot.weight,
        }
    )


def unpack(vector: Array, guess: InitialGuess, robot: RobotModel, scope: Scope) -> Trajectory:
    """The trajectory of a decision vector; ends and start feet are those of the guess."""
    blocks = variable_blocks(scope).unpack(vector)
    slot_of_foot = np.argsort(guess.order)
    order = list(guess.order)
    control = guess.control_points.copy()
    control[END_POINTS:-END_POINTS] = blocks["control"]
    feet = guess.trajectory.footholds[order].copy()
    feet[:, 1:, :2] = blocks["footholds"]
    times = guess.trajectory.contact_times[order].copy()
    times[:, 1:-1] = blocks["times"]
    duration = (times[:, 2::2] - times[:, 1:-1:2])[..., None]
    middle = _swing_middle(feet, scope) + blocks["swing_offset"]
    velocity = (_straight_drift(feet) + blocks["swing_drift"]) / duration
    return Trajectory(
        base_start=np.array(0.0),
        base_nodes=hermite_nodes(control, BASE_STEP),
        contact_times=times[slot_of_foot],
        footholds=feet[slot_of_foot],
        swing_nodes=np.concatenate([middle, velocity], axis=-1)[slot_of_foot],
        force_nodes=_force_nodes(blocks["forces"] * robot.weight, times)[slot_of_foot],
    )


def _swing_middle(feet: Array, scope: Scope) -> Array:
    """Point half-way between footholds (4, S, 3), raised by the clearance, (4, S − 1, 3) in m."""
    middle = 0.5 * (feet[:, 1:] + feet[:, :-1])
    middle[..., 2] += scope.clearance
    return middle


def _straight_drift(feet: Array) -> Array:
    """Mid-swing velocity of a straight step times its duration, (4, S − 1, 2) in m."""
    return np.asarray(SWING_SPEED * (feet[:, 1:, :2] - feet[:, :-1, :2]))


def _piece_durations(times: Array) -> Array:
    """Durations of the force cubics of each stance, (4, S, 1, 1) in s."""
    return np.asarray((times[:, 1::2] - times[:, 0::2])[..., None, None] / FORCE_PIECES)


def _bezier_points(nodes: Array, times: Array) -> Array:
    """Free Bézier points (4, n, 3) of force nodes (4, S, 3, 2, 3), in the unit of these."""
    value = nodes[..., 0, :]
    third = nodes[..., 1, :] * _piece_durations(times) / BEZIER_DEGREE
    before, after = value - third, value + third
    middle = np.stack([before[:, :, 1], after[:, :, 1]], axis=2).reshape(N_FEET, -1, 3)
    first = np.stack([value[:, 0, 0], after[:, 0, 0]], axis=1)
    last = np.stack([before[:, -1, -1], value[:, -1, -1]], axis=1)
    return np.concatenate([first, middle, last], axis=1)


def _force_nodes(points: Array, times: Array) -> Array:
    """Force nodes (4, S, 3, 2, 3) of free Bézier points; the inverse of :func:`_bezier_points`."""
    first, middle, last = np.split(points, [END_FORCE_POINTS, -END_FORCE_POINTS], axis=1)
    n_stances = middle.shape[1] // MIDDLE_FORCE_POINTS
    per_third = BEZIER_DEGREE / _piece_durations(times)[:, :, 0]
    nodes = np.zeros((N_FEET, n_stances, FORCE_PIECES + 1, 2, 3))
    before, after = middle[:, 0::2], middle[:, 1::2]
    nodes[:, :, 1, 0] = 0.5 * (before + after)
    nodes[:, :, 1, 1] = 0.5 * (after - before) * per_third
    nodes[:, 0, 0, 0] = first[:, 0]
    nodes[:, 0, 0, 1] = (first[:, 1] - first[:, 0]) * per_third[:, 0]
    nodes[:, -1, -1, 0] = last[:, 1]
    nodes[:, -1, -1, 1] = (last[:, 1] - last[:, 0]) * per_third[:, -1]
    return nodes
