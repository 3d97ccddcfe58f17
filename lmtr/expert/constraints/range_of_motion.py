"""Range of motion: every foot stays in a box around its neutral position in the base frame.

Held at every ``range_of_motion_step``, in stance and in swing. Rows are offsets in half sides of
the box. The same offset carries a small cost, so that feet prefer their neutral positions.
"""

import casadi as ca
import numpy as np

from lmtr.arrays import Indices
from lmtr.expert.context import Context
from lmtr.expert.element import (
    ConstraintGroup,
    Element,
    Instances,
    instances,
    symbols,
)
from lmtr.expert.gating import swing_displacement
from lmtr.geometry.rotation import rotation_rows
from lmtr.robot.model import N_FEET


def range_of_motion(context: Context) -> ConstraintGroup:
    """Three rows per sample and foot, from the first sample after the given start."""
    step = context.settings.range_of_motion_step
    count = context.quantities["position"].shape[0] - 1
    rows = np.arange(count * N_FEET * 3).reshape(count, N_FEET, 3)
    met: dict[int, list[tuple[int, int, int]]] = {}
    for sample in range(1, count + 1):
        for slot in range(N_FEET):
            first, last = context.windows.swings_met(slot, sample * step)
            met.setdefault(last - first, []).append((sample, slot, first))
    elements = []
    for swings, triples in sorted(met.items()):
        sample, slot, first = np.array(triples).T
        where = _instances(context, swings, sample, slot, first, rows)
        elements.append(_offset(context, swings, where))
    ones = np.ones(rows.size)
    return ConstraintGroup("range_of_motion", elements, -ones, ones)


def _instances(
    context: Context, swings: int, sample: Indices, slot: Indices, first: Indices, rows: Indices
) -> Instances:
    """Inputs: base pose, times, footholds and middles of the swings that the sample can meet."""
    quantities, parameters = context.quantities, context.parameters
    chosen: list[Indices] = [quantities["position"][sample], quantities["rpy"][sample]]
    for k in range(swings):
        chosen.append(quantities["times"][slot, 2 * (first + k)])
        chosen.append(quantities["times"][slot, 2 * (first + k) + 1])
    chosen += [quantities["footholds"][slot, first + k] for k in range(swings + 1)]
    for k in range(swings):
        chosen.append(quantities["middle"][slot, first + k])
        chosen.append(quantities["middle_slope"][slot, first + k])
    weight = np.broadcast_to(parameters["foot_offset"], sample.shape)
    return instances(
        chosen,
        [parameters["nominal_feet"][slot], weight],
        [sample * context.settings.range_of_motion_step],
        [rows[sample - 1, slot]],
    )


def _offset(context: Context, swings: int, where: Instances) -> Element:
    """Offset of a foot that may be in any of ``swings`` swings, or in a stance beside them."""
    robot, inputs = context.robot, symbols(where)
    q = inputs.quantities
    sizes = [3, 3, *[1] * (2 * swings), *[2] * (swings + 1), *[3, 2] * swings]
    parts = ca.vertsplit(q, np.cumsum([0, *sizes]).tolist())
    position, rpy = parts[:2]
    changes = parts[2 : 2 + 2 * swings]
    feet = [ca.vertcat(foot, 0.0) for foot in parts[2 + 2 * swings : 3 + 3 * swings]]
    middles = parts[3 + 3 * swings :]
    foot = feet[0]
    for k in range(swings):
        foot += swing_displacement(
            inputs.constants,
            changes[2 * k],
            changes[2 * k + 1],
            feet[k],
            middles[2 * k],
            ca.vertcat(middles[2 * k + 1], 0.0),
            feet[k + 1],
        )
    roll, pitch, yaw = ca.vertsplit(rpy)
    rotation = ca.vertcat(*[ca.horzcat(*row) for row in rotation_rows(roll, pitch, yaw, ca)])
    neutral_B = ca.vertcat(inputs.parameters[:2], -robot.nominal_height)
    offset = (rotation.T @ (foot - position) - neutral_B) / ca.DM(robot.range_of_motion)
    weight = inputs.parameters[2] * context.settings.range_of_motion_step
    slope = ca.jacobian(offset, q)
    times = tuple(range(6, 6 + 2 * swings))
    return Element(
        f"foot_offset_{swings}",
        inputs,
        where,
        rows=offset,
        cost=weight * ca.sumsqr(offset),
        cost_name="foot_offset",
        cost_hessian=2.0 * weight * (slope.T @ slope),  # Gauss–Newton: never indefinite
        without_curvature=times,
    )
