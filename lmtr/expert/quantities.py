"""Physical quantities that the constraints and costs speak of, all linear in the variables.

A quantity vector is q = C·[x; p] + c (E6) with variables x and parameters p. The element
functions of constraints and costs are written in q, and the assembly carries their derivatives
over to x through the constant C.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from lmtr.arrays import Array, Indices
from lmtr.expert.blocks import Blocks
from lmtr.expert.initial_guess import SWING_SPEED
from lmtr.expert.settings import ExpertSettings
from lmtr.expert.variables import END_POINTS, variable_blocks
from lmtr.robot.model import N_FEET
from lmtr.spline.bspline import acceleration_weights, value_weights, velocity_weights
from lmtr.task.task import MAX_OBSTACLES
from lmtr.trajectory.trajectory import BASE_STEP

SAME_AS_VARIABLES = ("times", "swing_offset", "swing_drift", "forces")
"""Quantities that are variables themselves."""


def n_samples(settings: ExpertSettings) -> int:
    """Times at which the base's motion is among the quantities, from 0 to T̄."""
    return (settings.scope.n_nodes - 1) * settings.base_samples_per_knot + 1


def parameter_blocks(settings: ExpertSettings) -> Blocks:
    """Blocks of the parameter vector: whatever may change without building the problem anew.

    start, goal: Base position (m) and roll, pitch, yaw (rad) at rest.
    start_feet, nominal_feet: x, y of the first footholds in the world and of the neutral ones in
        the base frame (m), by slot.
    reference: x, y of the points that moments are taken about, one per sample of the base (m).
    line_normals, line_offsets, line_weights: Unit normal n, offset n·p (m) and height of the
        potential of each obstacle; a problem has room for ``MAX_OBSTACLES`` lines, and those not
        used have weight zero.
    Weights of the costs, and the proximal damping ρ.
    """
    return Blocks(
        {
            "start": (6,),
            "goal": (6,),
            "start_feet": (N_FEET, 2),
            "nominal_feet": (N_FEET, 2),
            "reference": (n_samples(settings), 2),
            "line_normals": (MAX_OBSTACLES, 2),
            "line_offsets": (MAX_OBSTACLES,),
            "line_weights": (MAX_OBSTACLES,),
            "proximal": (),
            **dict.fromkeys(type(settings.costs).model_fields, ()),
        }
    )


def quantity_blocks(settings: ExpertSettings) -> Blocks:
    """Blocks of the quantity vector.

    position, rpy, rpy_rate, acceleration, rpy_acceleration: Base (m, rad, s) at ``n_samples``
        times from 0 to T̄, of which every base node is one (E3).
    footholds: x, y of every stance (m), by slot.
    middle: Position of the middle of each swing (m), by slot.
    middle_slope: Its horizontal velocity times half the swing's duration (E5) (m), by slot.
    Besides, the variables ``SAME_AS_VARIABLES``.
    """
    scope, variables = settings.scope, variable_blocks(settings.scope)
    samples = n_samples(settings)
    return Blocks(
        {
            "position": (samples, 3),
            "rpy": (samples, 3),
            "rpy_rate": (samples, 3),
            "acceleration": (samples, 3),
            "rpy_acceleration": (samples, 3),
            "footholds": (N_FEET, scope.n_stances, 2),
            "middle": (N_FEET, scope.n_swings, 3),
            "middle_slope": (N_FEET, scope.n_swings, 2),
            **variables.shapes(*SAME_AS_VARIABLES),
        }
    )


@dataclass(frozen=True)
class LinearMap:
    """q = of_variables·x + of_parameters·p + constant (E6), as sparse matrices."""

    of_variables: sp.csr_matrix
    of_parameters: sp.csr_matrix
    constant: Array


class _Rows:
    """Collects the rows of q = C·v + c."""

    def __init__(self, n_rows: int, n_columns: int) -> None:
        self._entries: list[tuple[Indices, Indices, Array]] = []
        self.shape = (n_rows, n_columns)
        self.constant = np.zeros(n_rows)

    def add(self, rows: Indices, columns: Indices, weight: float) -> None:
        """Add ``weight``·v[columns] to q[rows], elementwise."""
        columns = np.broadcast_to(columns, rows.shape)
        self._entries.append(
            (rows.reshape(-1), columns.reshape(-1), np.full(rows.size, float(weight)))
        )

    def matrix(self) -> sp.csr_matrix:
        rows, columns, weights = (np.concatenate(part) for part in zip(*self._entries, strict=True))
        matrix = sp.csr_matrix((weights, (rows, columns)), shape=self.shape)
        matrix.sum_duplicates()
        matrix.eliminate_zeros()
        return matrix


def linear_map(settings: ExpertSettings) -> LinearMap:
    """The constant map from variables and parameters to quantities."""
    x, p = variable_blocks(settings.scope), parameter_blocks(settings)
    quantities = quantity_blocks(settings)
    rows = _Rows(quantities.size, x.size + p.size)
    _add_base(rows, quantities, x, p, settings)
    _add_swings(rows, quantities, x, p, settings)
    for name in SAME_AS_VARIABLES:
        rows.add(quantities[name], x[name], 1.0)
    matrix = rows.matrix()
    return LinearMap(matrix[:, : x.size].tocsr(), matrix[:, x.size :].tocsr(), rows.constant)


def _add_base(
    rows: _Rows, quantities: Blocks, x: Blocks, p: Blocks, settings: ExpertSettings
) -> None:
    start, goal = (np.tile(p[name] + x.size, (END_POINTS, 1)) for name in ("start", "goal"))
    control = np.concatenate([start, x["control"], goal])  # columns of all control points
    per_knot = settings.base_samples_per_knot
    knot, part = np.divmod(np.arange(n_samples(settings)), per_knot)
    values = np.concatenate([quantities["position"], quantities["rpy"]], axis=1)
    accelerations = np.concatenate(
        [quantities["acceleration"], quantities["rpy_acceleration"]], axis=1
    )
    for remainder in range(per_knot):
        chosen, u = np.flatnonzero(part == remainder), remainder / per_knot
        values_of, rates_of = value_weights(u), velocity_weights(u, BASE_STEP)
        accelerations_of = acceleration_weights(u, BASE_STEP)
        for k in range(4):
            # The last knot has no fourth control point, nor any weight on it.
            columns = control[np.minimum(knot[chosen] + k, len(control) - 1)]
            rows.add(values[chosen], columns, values_of[k])
            rows.add(quantities["rpy_rate"][chosen], columns[:, 3:], rates_of[k])
            rows.add(accelerations[chosen], columns, accelerations_of[k])


def _add_swings(
    rows: _Rows, quantities: Blocks, x: Blocks, p: Blocks, settings: ExpertSettings
) -> None:
    feet = np.concatenate([p["start_feet"][:, None] + x.size, x["footholds"]], axis=1)
    rows.add(quantities["footholds"], feet, 1.0)
    middle, slope = quantities["middle"], quantities["middle_slope"]
    rows.add(middle, x["swing_offset"], 1.0)
    rows.constant[middle[..., 2]] = settings.scope.clearance
    rows.add(slope, x["swing_drift"], 0.5)
    for stance, sign in ((feet[:, :-1], -1.0), (feet[:, 1:], 1.0)):
        rows.add(middle[..., :2], stance, 0.5)
        rows.add(slope, stance, 0.5 * SWING_SPEED * sign)
