"""One kind of term of the problem, written once and instantiated at many places.

An element is a small function of a few quantities; its instances differ in which quantities,
parameters and rows they take, and in constants such as the sample's time. Constraints and costs
are nothing but lists of elements; the assembly maps, scatters and differentiates them.
"""

from dataclasses import dataclass, field

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from lmtr.arrays import Array, Indices


@dataclass(frozen=True)
class Symbols:
    """Inputs of an element function: column vectors of CasADi scalars."""

    quantities: ca.SX
    parameters: ca.SX
    constants: ca.SX


@dataclass(frozen=True)
class Instances:
    """Where an element occurs, K times.

    Attributes:
        quantities: Positions of its inputs in the quantity vector, (K, n).
        parameters: Positions of its parameters in the parameter vector, (K, m).
        constants: Its constants, (K, c).
        rows: Positions of its outputs among the rows of its constraint group, (K, r); instances
            that share a row add up. Costs have r = 0.
    """

    quantities: Indices
    parameters: Indices
    constants: Array
    rows: Indices

    def __len__(self) -> int:
        return len(self.quantities)


@dataclass(frozen=True)
class Element:
    """One kind of term: expressions in its symbols, and its instances.

    Attributes:
        name: Name in generated code.
        symbols: Its inputs.
        instances: Where it occurs.
        rows: Constraint values, (r,), or empty.
        cost: Its share of the cost ``cost_name``, or zero.
        cost_name: Name of that cost.
        cost_hessian: What the solver takes as second derivative of the cost, (n, n); by default
            the exact one.
        without_curvature: Inputs with respect to which the solver is told no curvature of rows.
            This keeps the Hessian from having directions of wrong curvature, which cost
            iterations, and moves no solution: only derivatives of first order define it.
    """

    name: str
    symbols: Symbols
    instances: Instances
    rows: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    cost: ca.SX = field(default_factory=lambda: ca.SX(0.0))
    cost_name: str = ""
    cost_hessian: ca.SX | None = None
    without_curvature: tuple[int, ...] = ()


def symbols(instances: Instances) -> Symbols:
    """Fresh symbols for the inputs of an element with these instances."""
    return Symbols(
        ca.SX.sym("q", instances.quantities.shape[1]),
        ca.SX.sym("p", instances.parameters.shape[1]),
        ca.SX.sym("c", instances.constants.shape[1]),
    )


def instances(
    quantities: list[Indices],
    parameters: list[Indices] | None = None,
    constants: list[NDArray[np.floating]] | None = None,
    rows: list[Indices] | None = None,
) -> Instances:
    """Instances whose inputs are the columns (K, …) given, side by side."""
    count = len(quantities[0])

    def columns(parts: list[Indices] | None) -> Indices:
        if not parts:
            return np.zeros((count, 0), dtype=np.intp)
        return np.concatenate([np.reshape(part, (count, -1)) for part in parts], axis=1)

    values = [np.reshape(part, (count, -1)) for part in constants or []]
    return Instances(
        columns(quantities),
        columns(parameters),
        np.concatenate(values, axis=1) if values else np.zeros((count, 0)),
        columns(rows),
    )


@dataclass(frozen=True)
class ConstraintGroup:
    """Rows of one kind: lower ≤ Σ elements ≤ upper, flattened."""

    name: str
    elements: list[Element]
    lower: Array
    upper: Array
