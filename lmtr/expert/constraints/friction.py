"""Friction pyramid |f_x|, |f_y| ≤ μ f_z on every Bézier point of the forces (E20).

A cubic lies in the convex hull of its Bézier points and the pyramid is convex, so these linear
rows hold the friction law at all times, not at nodes only. That a force pushes and is bounded
(0 ≤ f_z) is a bound on the same points.
"""

import casadi as ca
import numpy as np

from lmtr.expert.context import Context
from lmtr.expert.element import ConstraintGroup, Element, instances, symbols


def friction(context: Context) -> ConstraintGroup:
    """Four rows per free Bézier point, in weights."""
    points = context.quantities["forces"].reshape(-1, 3)
    rows = np.arange(4 * len(points)).reshape(-1, 4)
    where = instances({"point": points}, rows=rows)
    inputs = symbols(where)
    x, y, z = ca.vertsplit(inputs["point"])
    limit = context.robot.friction * z
    sides = ca.vertcat(limit - x, limit + x, limit - y, limit + y)
    return ConstraintGroup(
        "friction",
        [Element("friction", inputs, where, rows=sides)],
        np.zeros(rows.size),
        np.full(rows.size, np.inf),
    )
