"""One kind of term of the problem, written once and instantiated at many places.

An element is a small function of a few quantities; its instances differ in which quantities,
parameters and rows they take, and in constants such as the sample's time. Constraints and costs
are nothing but lists of elements; the assembly maps, scatters and differentiates them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from lmtr.arrays import Array, Indices
from lmtr.expert.blocks import Blocks

Columns = NDArray[Any]
"""Positions or constants, one row per instance."""


@dataclass(frozen=True)
class Symbols:
    """Inputs of an element function: column vectors of CasADi scalars, whole and by name.

    ``inputs["rpy"]`` is what was put into the instances under that name, flattened.
    """

    quantities: ca.SX
    parameters: ca.SX
    constants: ca.SX
    named: Mapping[str, ca.SX]

    def __getitem__(self, name: str) -> ca.SX:
        return self.named[name]


@dataclass(frozen=True)
class Instances:
    """Where an element occurs, K times.

    Attributes:
        quantities: Positions of its inputs in the quantity vector, (K, n).
        parameters: Positions of its parameters in the parameter vector, (K, m).
        constants: Its constants, (K, c).
        rows: Positions of its outputs among the rows of its constraint group, (K, r); instances
            that share a row add up. Costs have r = 0.
        names: Named blocks of its n quantities, m parameters and c constants.
    """

    quantities: Indices
    parameters: Indices
    constants: Array
    rows: Indices
    names: tuple[Blocks, Blocks, Blocks]

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
        without_curvature: Names of the quantities with respect to which the solver is told no
            curvature of rows (E27). This keeps the Hessian from having directions of wrong
            curvature, which cost iterations, and moves no solution: only derivatives of first
            order define it.
    """

    name: str
    symbols: Symbols
    instances: Instances
    rows: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    cost: ca.SX = field(default_factory=lambda: ca.SX(0.0))
    cost_name: str = ""
    cost_hessian: ca.SX | None = None
    without_curvature: tuple[str, ...] = ()


def symbols(instances: Instances) -> Symbols:
    """Fresh symbols for the inputs of an element with these instances."""
    q, p, c = (ca.SX.sym(letter, b.size) for letter, b in zip("qpc", instances.names, strict=True))
    named = {
        name: vector[blocks[name].tolist()]
        for vector, blocks in zip((q, p, c), instances.names, strict=True)
        for name in blocks.names
    }
    return Symbols(q, p, c, named)


def instances(
    quantities: Mapping[str, Indices],
    parameters: Mapping[str, Indices] | None = None,
    constants: Mapping[str, Columns] | None = None,
    rows: Indices | None = None,
) -> Instances:
    """Instances whose inputs are the arrays (K, …) given, flattened and side by side.

    All names are distinct; they are how the element's expressions speak of its inputs.
    """
    count = len(next(iter(quantities.values())))

    def columns(parts: Mapping[str, Columns] | None) -> dict[str, Columns]:
        return {name: np.reshape(part, (count, -1)) for name, part in (parts or {}).items()}

    def joined(parts: dict[str, Columns], dtype: type) -> Columns:
        return np.concatenate([np.zeros((count, 0), dtype), *parts.values()], axis=1)

    inputs = columns(quantities), columns(parameters), columns(constants)
    of_quantities, of_parameters, of_constants = inputs
    names = [Blocks({name: part.shape[1:] for name, part in parts.items()}) for parts in inputs]
    return Instances(
        joined(of_quantities, np.intp),
        joined(of_parameters, np.intp),
        joined(of_constants, np.float64),
        joined({} if rows is None else columns({"rows": rows}), np.intp),
        (names[0], names[1], names[2]),
    )


@dataclass(frozen=True)
class ConstraintGroup:
    """Rows of one kind: lower ≤ M·Σ elements ≤ upper, flattened.

    Attributes:
        name: Name of the group.
        elements: What is added up.
        lower, upper: Bounds of the rows.
        mixing: M, which makes the rows of the sums; identity by default.
    """

    name: str
    elements: list[Element]
    lower: Array
    upper: Array
    mixing: sp.csr_matrix | None = None

    @property
    def matrix(self) -> sp.csr_matrix:
        """M as a matrix."""
        return sp.identity(len(self.lower), format="csr") if self.mixing is None else self.mixing
