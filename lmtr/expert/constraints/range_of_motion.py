"""Range of motion (E18): feet stay in boxes around their neutral positions in the base frame.

Held at every ``range_of_motion_step``, in stance and in swing, with a margin for what feet do in
between. Rows are offsets in half sides of the box. At the base nodes the same offset carries a
small cost (E24), so that feet prefer their neutral positions.
"""

import casadi as ca
import numpy as np

from lmtr.arrays import Indices
from lmtr.expert.context import Context
from lmtr.expert.element import (
    ConstraintGroup,
    Element,
    Instances,
    Symbols,
    instances,
    symbols,
)
from lmtr.expert.gating import swing_displacement
from lmtr.expert.rotation import rotation_matrix
from lmtr.robot.model import N_FEET
from lmtr.trajectory.trajectory import BASE_STEP


def range_of_motion(context: Context) -> ConstraintGroup:
    """Three rows per sample and foot, from the first sample after the given start."""
    step = context.settings.range_of_motion_step
    count = (context.settings.scope.n_nodes - 1) * context.settings.samples_per_knot
    rows = np.arange(count * N_FEET * 3).reshape(count, N_FEET, 3)
    met: dict[tuple[int, bool], list[tuple[int, int, int]]] = {}
    for sample in range(1, count + 1):
        at_node = sample % context.settings.samples_per_knot == 0
        for slot in range(N_FEET):
            first, last = context.windows.swings_met(slot, sample * step)
            met.setdefault((last - first, at_node), []).append((sample, slot, first))
    elements = []
    for (swings, at_node), triples in sorted(met.items()):
        sample, slot, first = np.array(triples).T
        where = _instances(context, swings, sample, slot, first, rows)
        elements.append(_offset(context, swings, at_node, where))
    share = 1.0 - context.settings.range_of_motion_margin / np.array(context.robot.range_of_motion)
    limit = np.tile(share, rows.size // 3)
    return ConstraintGroup("range_of_motion", elements, -limit, limit)


def _instances(
    context: Context, swings: int, sample: Indices, slot: Indices, first: Indices, rows: Indices
) -> Instances:
    """Inputs: base pose, times, footholds and middles of the swings that the sample can meet."""
    quantities, slots, firsts = context.quantities, slot[:, None], first[:, None]
    steps = firsts + np.arange(swings)
    changes = 2 * firsts + np.arange(2 * swings)
    of_base = sample * context.settings.base_samples_per_knot // context.settings.samples_per_knot
    return instances(
        {
            "position": quantities["position"][of_base],
            "rpy": quantities["rpy"][of_base],
            "times": quantities["times"][slots, changes],
            "footholds": quantities["footholds"][slots, firsts + np.arange(swings + 1)],
            "middles": quantities["middle"][slots, steps],
            "middle_slopes": quantities["middle_slope"][slots, steps],
        },
        {
            "nominal_foot": context.parameters["nominal_feet"][slot],
            "weight": np.broadcast_to(context.parameters["foot_offset"], sample.shape),
        },
        {"time": sample * context.settings.range_of_motion_step},
        rows[sample - 1, slot],
    )


def _offset(context: Context, swings: int, at_node: bool, where: Instances) -> Element:
    """Offset of a foot that may be in any of ``swings`` swings, or in a stance beside them."""
    robot, inputs = context.robot, symbols(where)
    foot_W = _foot(inputs, swings)
    neutral_B = ca.vertcat(inputs["nominal_foot"], -robot.nominal_height)
    offset_B = rotation_matrix(inputs["rpy"]).T @ (foot_W - inputs["position"]) - neutral_B
    offset = offset_B / ca.DM(robot.range_of_motion)
    # The curvature of the cost stands for that of the rows, which saves no iterations.
    uncurved = tuple(where.names[0].names)
    if not at_node:
        name = f"foot_between_nodes_{swings}"
        return Element(name, inputs, where, rows=offset, without_curvature=uncurved)
    weight, slope = inputs["weight"] * BASE_STEP, ca.jacobian(offset, inputs.quantities)
    return Element(
        f"foot_offset_{swings}",
        inputs,
        where,
        rows=offset,
        cost=weight * ca.sumsqr(offset),
        cost_name="foot_offset",
        cost_hessian=2.0 * weight * (slope.T @ slope),  # Gauss–Newton: never indefinite
        without_curvature=uncurved,
    )


def _foot(inputs: Symbols, swings: int) -> ca.SX:
    """Position of the foot (m): its first foothold and the ways of the swings since (E9)."""
    changes = ca.vertsplit(inputs["times"])
    footholds = [ca.vertcat(xy, 0.0) for xy in ca.vertsplit(inputs["footholds"], 2)]
    middles = ca.vertsplit(inputs["middles"], 3)
    slopes = [ca.vertcat(xy, 0.0) for xy in ca.vertsplit(inputs["middle_slopes"], 2)]
    foot = footholds[0]
    for k in range(swings):
        liftoff, touchdown = changes[2 * k : 2 * k + 2]
        foot += swing_displacement(
            inputs["time"],
            liftoff,
            touchdown,
            footholds[k],
            middles[k],
            slopes[k],
            footholds[k + 1],
        )
    return foot
