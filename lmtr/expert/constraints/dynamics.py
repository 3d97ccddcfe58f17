"""Single-rigid-body dynamics at the base nodes (Sec. 4.1).

Linear: Σ f_i = m(r̈ + g e_z). Angular, about the origin shifted to a constant reference c:
Σ (p_i − c) × f_i = (r − c) × m(r̈ + g e_z) + d/dt(I_W ω). With the linear rows this is the usual
balance about the centre of mass r; but base and contacts are then additively separable, so no
contact couples with the base's motion in the Jacobian or Hessian. The reference is the guessed
base position, which keeps lever arms, and with them the scaling, as they are about r.

Rows are in weights and in weights times ``LEVER_ARM``.
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
from lmtr.expert.gating import stance_force
from lmtr.expert.variables import stance_points
from lmtr.geometry.rotation import rate_rows, rate_rows_derivative, rotation_rows
from lmtr.robot.model import GRAVITY, N_FEET, RobotModel
from lmtr.trajectory.trajectory import BASE_STEP

FIRST, MIDDLE, LAST = range(3)
"""Kinds of stances: the first begins and the last ends with a force of its own."""

LEVER_ARM = 0.3
"""Unit of moments over the weight (m): the size of the legs' lever arms."""


def dynamics(context: Context) -> ConstraintGroup:
    """Six equality rows per base node."""
    nodes = context.settings.scope.n_nodes
    rows = np.arange(nodes * 6).reshape(nodes, 6)
    elements = [_base(context, rows), *_contacts(context, rows)]
    zero = np.zeros(nodes * 6)
    return ConstraintGroup("dynamics", elements, zero, zero)


def _base(context: Context, rows: Indices) -> Element:
    """Minus the change of momentum, in weights."""
    robot, quantities = context.robot, context.quantities
    per_knot = context.samples_per_knot
    where = instances(
        [
            quantities["position"][::per_knot],
            quantities["rpy"][::per_knot],
            quantities["rpy_rate"],
            quantities["acceleration"],
            quantities["rpy_acceleration"],
        ],
        [context.parameters["reference"]],
        rows=[rows],
    )
    inputs = symbols(where)
    position, rpy, rate, acceleration, rpy_acceleration = ca.vertsplit(inputs.quantities, 3)
    needed = acceleration / GRAVITY + ca.vertcat(0.0, 0.0, 1.0)
    arm = position - ca.vertcat(inputs.parameters, robot.nominal_height)
    spin = _angular_momentum_rate(robot, rpy, rate, rpy_acceleration) / robot.weight
    angular = (ca.cross(arm, needed) + spin) / LEVER_ARM
    return Element("momentum", inputs, where, rows=-ca.vertcat(needed, angular))


def _angular_momentum_rate(robot: RobotModel, rpy: ca.SX, rate: ca.SX, second: ca.SX) -> ca.SX:
    """d/dt(I_W ω) = R·(I_B ω̇_B + ω_B × I_B ω_B) in N·m, where ω̇_B is Rᵀω̇_W."""
    roll, pitch, yaw = ca.vertsplit(rpy)
    rotation = _matrix(rotation_rows(roll, pitch, yaw, ca))
    _, pitch_rate, yaw_rate = ca.vertsplit(rate)
    rates = _matrix(rate_rows(pitch, yaw, ca))
    rates_derivative = _matrix(rate_rows_derivative(pitch, yaw, pitch_rate, yaw_rate, ca))
    inertia = ca.DM(robot.inertia_B)
    omega_B = rotation.T @ (rates @ rate)
    change_B = rotation.T @ (rates @ second + rates_derivative @ rate)
    return rotation @ (inertia @ change_B + ca.cross(omega_B, inertia @ omega_B))


def _matrix(rows: list[list[ca.SX]]) -> ca.SX:
    return ca.vertcat(*[ca.horzcat(*row) for row in rows])


def _contacts(context: Context, rows: Indices) -> list[Element]:
    """Forces of first, middle and last stances: three elements, for their ends differ."""
    scope = context.settings.scope
    met: dict[int, list[tuple[int, int, int]]] = {}
    for node in range(scope.n_nodes):
        for slot in range(N_FEET):
            for stance in context.windows.stances_met(slot, node * BASE_STEP):
                kind = FIRST if stance == 0 else LAST if stance == scope.n_swings else MIDDLE
                met.setdefault(kind, []).append((node, slot, stance))
    elements = []
    for kind, triples in sorted(met.items()):
        node, slot, stance = np.array(triples).T
        where = _contact_instances(context, kind, node, slot, stance, rows)
        elements.append(_contact(context, kind, where))
    return elements


def _contact_instances(
    context: Context, kind: int, node: Indices, slot: Indices, stance: Indices, rows: Indices
) -> Instances:
    """Inputs: the stance's variable contact changes, its foothold, its force points."""
    times, points = context.quantities["times"], context.quantities["forces"]
    begin = [] if kind == FIRST else [times[slot, 2 * stance - 1]]
    end = [] if kind == LAST else [times[slot, 2 * stance]]
    n_stances = context.settings.scope.n_stances
    pushes = np.stack(
        [points[i, stance_points(j, n_stances)] for i, j in zip(slot, stance, strict=True)]
    )
    return instances(
        [*begin, *end, context.quantities["footholds"][slot, stance], pushes],
        [context.parameters["reference"][node]],
        [node * BASE_STEP],
        [rows[node]],
    )


def _contact(context: Context, kind: int, where: Instances) -> Element:
    """A foot's force and moment, zero outside its stance."""
    inputs = symbols(where)
    n_changes = 2 if kind == MIDDLE else 1
    changes = ca.vertsplit(inputs.quantities[:n_changes])
    foothold = inputs.quantities[n_changes : n_changes + 2]
    pushes = ca.vertsplit(inputs.quantities[n_changes + 2 :], 3)
    at_rest = [ca.SX.zeros(3)] * 2
    begin = 0.0 if kind == FIRST else changes[0]
    end = context.settings.scope.duration if kind == LAST else changes[-1]
    before = [] if kind == FIRST else at_rest
    after = [] if kind == LAST else at_rest
    force = stance_force(inputs.constants, begin, end, [*before, *pushes, *after])
    arm = ca.vertcat(foothold - inputs.parameters, -context.robot.nominal_height)
    return Element(
        ("first_stance", "stance", "last_stance")[kind],
        inputs,
        where,
        rows=ca.vertcat(force, ca.cross(arm, force) / LEVER_ARM),
        without_curvature=tuple(range(n_changes)),
    )
