"""Costs of the expert's problem (E22–E25): smooth motion, smooth forces, feet away from lines.

The paper names the obstacle cost (Sec. 4.2); the others keep solutions of one task comparable
and short stops near the optimum harmless. The cost on foot offsets stands beside the range of
motion, whose rows it shares.
"""

import casadi as ca
import numpy as np
from numpy.polynomial import Polynomial

from lmtr.arrays import Array, Indices
from lmtr.expert.context import Context
from lmtr.expert.element import Element, Instances, instances, symbols
from lmtr.expert.stances import StanceKind, stance_points
from lmtr.robot.model import N_FEET
from lmtr.task.task import MAX_OBSTACLES
from lmtr.trajectory.trajectory import BASE_STEP


def costs(context: Context) -> list[Element]:
    """All costs but that on foot offsets, and the damping of the Hessian."""
    quantities, nodes = (
        context.quantities,
        slice(None, None, context.settings.base_samples_per_knot),
    )
    position, rpy = quantities["position"][nodes], quantities["rpy"][nodes]
    points = quantities["forces"].reshape(-1, 3)

    def squares(name: str, chosen: Indices, unit: float, target: float = 0.0) -> Element:
        return _squares(name, chosen, context.parameters[name], unit, target)

    return [
        squares("acceleration", quantities["acceleration"][nodes], BASE_STEP),
        squares("angular_acceleration", quantities["rpy_acceleration"][nodes], BASE_STEP),
        squares("tilt", rpy[:, :2], BASE_STEP),
        squares("height", position[:, 2:], BASE_STEP, context.robot.nominal_height),
        squares("horizontal_force", points[:, :2], 1.0),
        squares("swing_offset", quantities["swing_offset"].reshape(-1, 3), 1.0),
        squares("swing_drift", quantities["swing_drift"].reshape(-1, 2), 1.0),
        *_force_roughness(context),
        _obstacles(context),
        _proximal("proximal_times", quantities["times"].reshape(-1, 1), context),
        _proximal("proximal_footholds", quantities["footholds"][:, 1:].reshape(-1, 2), context),
    ]


def _weighted(chosen: Indices, weight: Indices) -> Instances:
    return instances({"chosen": chosen}, {"weight": np.broadcast_to(weight, len(chosen))})


def _squares(name: str, chosen: Indices, weight: Indices, unit: float, target: float) -> Element:
    """Weight · unit · Σ (quantity − target)², a term of (E22–E24)."""
    where = _weighted(chosen, weight)
    inputs = symbols(where)
    cost = inputs["weight"] * unit * ca.sumsqr(inputs["chosen"] - target)
    return Element(name, inputs, where, cost=cost, cost_name=name)


def _force_roughness(context: Context) -> list[Element]:
    """Mean squared slope and curvature of each stance's cubics over their unit times (E23)."""
    points, n_stances = context.quantities["forces"], context.settings.scope.n_stances
    chosen: dict[StanceKind, list[Indices]] = {}
    for stance in range(n_stances):
        free = points[:, stance_points(stance, n_stances)].reshape(N_FEET, -1)
        chosen.setdefault(StanceKind.of(stance, n_stances), []).append(free)
    elements = []
    for kind, stances in chosen.items():
        for name, order in (("force_slope", 1), ("force_curvature", 2)):
            where = _weighted(np.concatenate(stances), context.parameters[name])
            inputs = symbols(where)
            cost = inputs["weight"] * _roughness(inputs["chosen"], kind, order)
            label = f"{name}_{kind.name.lower()}"
            elements.append(Element(label, inputs, where, cost=cost, cost_name=name))
    return elements


def _roughness(free: ca.SX, kind: StanceKind, order: int) -> ca.SX:
    """∫₀¹ |dⁿf/duⁿ|² du of the two cubics of a stance, summed."""
    p0, p1, before, after, p5, p6 = kind.all_points(ca.vertsplit(free, 3), ca.SX.zeros(3))
    middle = 0.5 * (before + after)
    gram = _bezier_gram(order)
    total = ca.SX(0.0)
    for cubic in ((p0, p1, before, middle), (middle, after, p5, p6)):
        stacked = ca.horzcat(*cubic)  # (3, 4)
        total += ca.sum1(ca.sum2(stacked * (stacked @ ca.DM(gram))))
    return total


def _bezier_gram(order: int) -> Array:
    """Gram matrix (4, 4) of the n-th derivatives of the cubic Bernstein polynomials."""
    u = Polynomial([0.0, 1.0])
    basis = [(1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u**2 * (1 - u), u**3]
    slopes = [polynomial.deriv(order) for polynomial in basis]
    return np.array([[(a * b).integ()(1.0) for b in slopes] for a in slopes])


def _obstacles(context: Context) -> Element:
    """Potential weight·exp(−d²/2σ²) of free footholds at distances d from lines (E25).

    Its curvature enters the Hessian by magnitude, |v''| (E28), for a foothold near a line sits on
    top of the potential, where the true one would send the step towards the line.
    """
    feet = context.quantities["footholds"][:, 1:].reshape(-1, 2)
    parameters = context.parameters
    lines = {
        "normal": parameters["line_normals"],
        "offset": parameters["line_offsets"],
        "weight": parameters["line_weights"],
    }
    where = instances(
        {"foot": np.repeat(feet, MAX_OBSTACLES, axis=0)},
        {name: np.concatenate([part] * len(feet)) for name, part in lines.items()},
    )
    inputs = symbols(where)
    normal = inputs["normal"]
    variance = context.settings.obstacle_sigma**2
    distance = ca.dot(normal, inputs["foot"]) - inputs["offset"]
    potential = inputs["weight"] * ca.exp(-(distance**2) / (2.0 * variance))
    curvature = potential * ca.fabs(distance**2 / variance - 1.0) / variance
    return Element(
        "obstacles",
        inputs,
        where,
        cost=potential,
        cost_name="obstacles",
        cost_hessian=curvature * (normal @ normal.T),
    )


def _proximal(name: str, chosen: Indices, context: Context) -> Element:
    """No cost, but the Hessian of ½ρ·Δ² around every iterate (E29)."""
    where = _weighted(chosen, context.parameters["proximal"])
    inputs = symbols(where)
    damping = inputs["weight"] * ca.SX.eye(chosen.shape[1])
    return Element(name, inputs, where, cost_hessian=damping)
