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

from lmtr.expert.element import ConstraintGroup, Element, instances, symbols
from lmtr.expert.gating import stance_force
from lmtr.expert.layout import Layout
from lmtr.expert.settings import ExpertSettings
from lmtr.expert.timing import Windows
from lmtr.expert.variables import stance_points
from lmtr.geometry.rotation import rate_rows, rate_rows_derivative, rotation_rows
from lmtr.robot.model import GRAVITY, N_FEET, RobotModel
from lmtr.trajectory.trajectory import BASE_STEP

LEVER_ARM = 0.3
"""Unit of moments over the weight (m): the size of the legs' lever arms."""


def dynamics(
    robot: RobotModel,
    settings: ExpertSettings,
    windows: Windows,
    quantities: Layout,
    parameters: Layout,
) -> ConstraintGroup:
    """Six equality rows per base node."""
    nodes = settings.scope.n_nodes
    rows = np.arange(nodes * 6).reshape(nodes, 6)
    elements = [_base(robot, settings, quantities, parameters, rows)]
    elements += _contacts(robot, settings, windows, quantities, parameters, rows)
    zero = np.zeros(nodes * 6)
    return ConstraintGroup("dynamics", elements, zero, zero)


def _base(
    robot: RobotModel,
    settings: ExpertSettings,
    quantities: Layout,
    parameters: Layout,
    rows: np.ndarray,
) -> Element:
    """Minus the change of momentum, in weights."""
    per_knot = round(BASE_STEP / settings.range_of_motion_step)
    where = instances(
        [
            quantities["position"][::per_knot],
            quantities["rpy"][::per_knot],
            quantities["rpy_rate"],
            quantities["acceleration"],
            quantities["rpy_acceleration"],
        ],
        [parameters["reference"]],
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
    rotation = _matrix(rotation_rows(*ca.vertsplit(rpy), ca))
    _, pitch, yaw = ca.vertsplit(rpy)
    _, pitch_rate, yaw_rate = ca.vertsplit(rate)
    rates = _matrix(rate_rows(pitch, yaw, ca))
    rates_derivative = _matrix(rate_rows_derivative(pitch, yaw, pitch_rate, yaw_rate, ca))
    inertia = ca.DM(robot.inertia_B)
    omega_B = rotation.T @ (rates @ rate)
    change_B = rotation.T @ (rates @ second + rates_derivative @ rate)
    return rotation @ (inertia @ change_B + ca.cross(omega_B, inertia @ omega_B))


def _matrix(rows: list[list[ca.SX]]) -> ca.SX:
    return ca.vertcat(*[ca.horzcat(*row) for row in rows])


def _contacts(
    robot: RobotModel,
    settings: ExpertSettings,
    windows: Windows,
    quantities: Layout,
    parameters: Layout,
    rows: np.ndarray,
) -> list[Element]:
    """Forces of first, middle and last stances: three elements, for their ends differ."""
    scope = settings.scope
    met: dict[int, list[tuple[int, int, int]]] = {}
    for node in range(scope.n_nodes):
        for slot in range(N_FEET):
            for stance in windows.stances_met(slot, node * BASE_STEP):
                kind = 0 if stance == 0 else 2 if stance == scope.n_stances - 1 else 1
                met.setdefault(kind, []).append((node, slot, stance))
    times, points = quantities["times"], quantities["forces"]
    elements = []
    for kind, triples in sorted(met.items()):
        node, slot, stance = np.array(triples).T
        changes = [] if kind == 0 else [times[slot, 2 * stance - 1]]
        changes += [] if kind == 2 else [times[slot, 2 * stance]]
        pushes = np.stack(
            [
                points[i, stance_points(j, scope.n_stances)]
                for i, j in zip(slot, stance, strict=True)
            ]
        )
        where = instances(
            [*changes, quantities["footholds"][slot, stance], pushes],
            [parameters["reference"][node]],
            [node * BASE_STEP],
            [rows[node]],
        )
        elements.append(_contact(robot, scope.duration, kind, len(changes), where))
    return elements


def _contact(robot: RobotModel, duration: float, kind: int, n_changes: int, where) -> Element:  # noqa: ANN001
    inputs = symbols(where)
    changes = ca.vertsplit(inputs.quantities[:n_changes])
    foothold = inputs.quantities[n_changes : n_changes + 2]
    pushes = ca.vertsplit(inputs.quantities[n_changes + 2 :], 3)
    zero = [ca.SX.zeros(3)] * 2
    begin = changes[0] if kind else 0.0
    end = duration if kind == 2 else changes[-1]
    points = (zero if kind else []) + pushes + (zero if kind < 2 else [])
    force = stance_force(inputs.constants, begin, end, points)
    arm = ca.vertcat(foothold - inputs.parameters, -robot.nominal_height)
    return Element(
        ("first_stance", "stance", "last_stance")[kind],
        inputs,
        where,
        rows=ca.vertcat(force, ca.cross(arm, force) / LEVER_ARM),
        without_curvature=tuple(range(n_changes)),
    )
