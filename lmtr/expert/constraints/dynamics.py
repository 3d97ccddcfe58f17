"""Single-rigid-body dynamics around the base nodes (E11–E17; Sec. 4.1).

Linear: Σ f_i = m(r̈ + g e_z) (E11). Angular, about a constant reference c instead of r (E13):
Σ (p_i − c) × f_i = (r − c) × m(r̈ + g e_z) + d/dt(I_W ω). With the linear rows this is the usual
balance about the centre of mass r; but base and contacts are then additively separable, so no
contact couples with the base's motion in the Jacobian or Hessian. The reference is the guessed
base position, which keeps lever arms, and with them the scaling, as they are about r.

What holds is not the balance at each node but its mean around the node, weighted with the hat
function that falls to zero at the neighbours (E15; a Galerkin method, by Simpson's rule: a third
each at the node and at the points half-way to its neighbours). The base's acceleration is linear
between nodes and forces are curved; collocation at the nodes would leave an error of one sign in
between, which adds up, while this one has no mean (E16): planned forces lead where the plan says
(E17). At the two ends, where the robot rests, the balance itself holds.

Rows are in weights and in weights times ``LEVER_ARM``.
"""

import casadi as ca
import numpy as np
import scipy.sparse as sp

from lmtr.arrays import Array, Indices
from lmtr.expert.context import Context
from lmtr.expert.element import (
    ConstraintGroup,
    Element,
    Instances,
    instances,
    symbols,
)
from lmtr.expert.gating import stance_force
from lmtr.expert.rotation import rate_matrix, rate_matrix_derivative, rotation_matrix
from lmtr.expert.settings import BALANCE_SAMPLES_PER_KNOT
from lmtr.expert.stances import StanceKind, stance_points
from lmtr.robot.model import GRAVITY, N_FEET, RobotModel
from lmtr.trajectory.trajectory import BASE_STEP

LEVER_ARM = 0.3
"""Unit of moments over the weight (m): the size of the legs' lever arms."""


def dynamics(context: Context) -> ConstraintGroup:
    """Six equality rows per base node."""
    nodes = context.settings.scope.n_nodes
    times = _sample_times(nodes)
    sums = np.arange(len(times) * 6).reshape(len(times), 6)
    elements = [_base(context, sums), *_contacts(context, times, sums)]
    zero = np.zeros(nodes * 6)
    return ConstraintGroup("dynamics", elements, zero, zero, _means(nodes))


def _sample_times(nodes: int) -> Array:
    """Nodes and the points half-way between them (s)."""
    count = (nodes - 1) * BALANCE_SAMPLES_PER_KNOT + 1
    return np.asarray(BASE_STEP / BALANCE_SAMPLES_PER_KNOT * np.arange(count))


def _means(nodes: int) -> sp.csr_matrix:
    """From balances at samples to their means around each node (E15), but at either end."""
    samples = BALANCE_SAMPLES_PER_KNOT * np.arange(1, nodes - 1)[:, None] + np.array([-1, 0, 1])
    columns = np.concatenate([[0], samples.reshape(-1), [BALANCE_SAMPLES_PER_KNOT * (nodes - 1)]])
    rows = np.concatenate([[0], np.repeat(np.arange(1, nodes - 1), 3), [nodes - 1]])
    weights = np.concatenate([[1.0], np.full(samples.size, 1.0 / 3.0), [1.0]])
    means = sp.csr_matrix((weights, (rows, columns)))
    return sp.kron(means, sp.identity(6), format="csr")


def _base(context: Context, sums: Indices) -> Element:
    """Minus the change of momentum, in weights (E14)."""
    robot, quantities = context.robot, context.quantities
    step = context.settings.base_samples_per_knot // BALANCE_SAMPLES_PER_KNOT
    chosen = slice(None, None, step)
    where = instances(
        {
            name: quantities[name][chosen]
            for name in ("position", "rpy", "rpy_rate", "acceleration", "rpy_acceleration")
        },
        {"reference": context.parameters["reference"][chosen]},
        rows=sums,
    )
    inputs = symbols(where)
    needed = inputs["acceleration"] / GRAVITY + ca.vertcat(0.0, 0.0, 1.0)
    arm = inputs["position"] - ca.vertcat(inputs["reference"], robot.nominal_height)
    spin = _angular_momentum_rate(
        robot, inputs["rpy"], inputs["rpy_rate"], inputs["rpy_acceleration"]
    )
    angular = (ca.cross(arm, needed) + spin / robot.weight) / LEVER_ARM
    return Element(
        "momentum",
        inputs,
        where,
        rows=-ca.vertcat(needed, angular),
        # Small beside the contacts' and the costs': leaving it out takes no more iterations.
        without_curvature=tuple(where.names[0].names),
    )


def _angular_momentum_rate(robot: RobotModel, rpy: ca.SX, rate: ca.SX, second: ca.SX) -> ca.SX:
    """d/dt(I_W ω) = R·(I_B ω̇_B + ω_B × I_B ω_B) in N·m, where ω̇_B is Rᵀω̇_W (E12)."""
    rotation, rates = rotation_matrix(rpy), rate_matrix(rpy)
    inertia = ca.DM(robot.inertia_B)
    omega_B = rotation.T @ (rates @ rate)
    change_B = rotation.T @ (rates @ second + rate_matrix_derivative(rpy, rate) @ rate)
    return rotation @ (inertia @ change_B + ca.cross(omega_B, inertia @ omega_B))


def _contacts(context: Context, times: Array, sums: Indices) -> list[Element]:
    """Forces of first, middle and last stances: three elements, for their ends differ."""
    scope = context.settings.scope
    met: dict[StanceKind, list[tuple[int, int, int]]] = {}
    for sample, time in enumerate(times):
        for slot in range(N_FEET):
            for stance in context.windows.stances_met(slot, time):
                kind = StanceKind.of(stance, scope.n_stances)
                met.setdefault(kind, []).append((sample, slot, stance))
    elements = []
    for kind, triples in sorted(met.items()):
        sample, slot, stance = np.array(triples).T
        where = _contact_instances(context, kind, sample, slot, stance, sums, times)
        elements.append(_contact(context, kind, where))
    return elements


def _contact_instances(
    context: Context,
    kind: StanceKind,
    sample: Indices,
    slot: Indices,
    stance: Indices,
    sums: Indices,
    times: Array,
) -> Instances:
    """Inputs: the stance's variable contact changes, its foothold, its force points."""
    changes, forces = context.quantities["times"], context.quantities["forces"]
    n_stances = context.settings.scope.n_stances
    pushes = [forces[i, stance_points(j, n_stances)] for i, j in zip(slot, stance, strict=True)]
    chosen = {"foothold": context.quantities["footholds"][slot, stance], "push": np.stack(pushes)}
    if kind is not StanceKind.FIRST:
        chosen["begin"] = changes[slot, 2 * stance - 1]
    if kind is not StanceKind.LAST:
        chosen["end"] = changes[slot, 2 * stance]
    step = context.settings.base_samples_per_knot // BALANCE_SAMPLES_PER_KNOT
    return instances(
        chosen,
        {"reference": context.parameters["reference"][step * sample]},
        {"time": times[sample]},
        sums[sample],
    )


def _contact(context: Context, kind: StanceKind, where: Instances) -> Element:
    """A foot's force and moment, zero outside its stance (E14)."""
    inputs = symbols(where)
    begin = 0.0 if kind is StanceKind.FIRST else inputs["begin"]
    end = context.settings.scope.duration if kind is StanceKind.LAST else inputs["end"]
    points = kind.all_points(ca.vertsplit(inputs["push"], 3), ca.SX.zeros(3))
    force = stance_force(inputs["time"], begin, end, points)
    arm = ca.vertcat(inputs["foothold"] - inputs["reference"], -context.robot.nominal_height)
    return Element(
        f"{kind.name.lower()}_stance",
        inputs,
        where,
        rows=ca.vertcat(force, ca.cross(arm, force) / LEVER_ARM),
        without_curvature=tuple({"begin", "end"} & inputs.named.keys()),
    )
