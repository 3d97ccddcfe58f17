"""From elements to the functions an interior-point solver calls: f, ∇f, g, ∂g/∂x, ∇²L.

Every element is differentiated once, as a small scalar expression graph; its instances are
gathered from the quantity vector and mapped. The nonzeros of all instances, laid end to end, are
brought to the nonzeros of the Jacobian or Hessian by one constant sparse matrix, which holds both
the scatter and the chain rule (E26, E27) through the linear quantities q = C·x + …:

    ∂g/∂x = (∂g/∂q)·C,    ∇²L = Cᵀ·(∇²_q L)·C.

So the expressions stay as small as the elements, and derivatives are exact by construction, but
for the curvature that elements leave out on purpose.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
import scipy.sparse as sp

from lmtr.arrays import Indices
from lmtr.expert.element import Element
from lmtr.expert.quantities import LinearMap
from lmtr.expert.scatter import Scatter, to_casadi


@dataclass(frozen=True)
class Placed:
    """An element with the place of its constraint group among the sums of all groups."""

    element: Element
    first_row: int

    @property
    def rows(self) -> Indices:
        """Sums that each instance adds to, (K, r)."""
        return self.element.instances.rows + self.first_row


@dataclass(frozen=True)
class Assembled:
    """The problem's functions of (x, p), under the names that CasADi's solvers use.

    Attributes:
        cost: nlp_f → f.
        constraints: nlp_g → g.
        cost_gradient: nlp_grad_f → f, ∇f.
        constraint_jacobian: nlp_jac_g → g, ∂g/∂x (sparse).
        hessian: nlp_hess_lag of (x, p, lam_f, lam_g) → upper triangle of ∇²L (sparse).
        cost_terms: nlp_terms → the costs by name, in the order of ``cost_names``; f is their sum.
    """

    cost: ca.Function
    constraints: ca.Function
    cost_gradient: ca.Function
    constraint_jacobian: ca.Function
    hessian: ca.Function
    cost_terms: ca.Function
    cost_names: tuple[str, ...]

    def all(self) -> list[ca.Function]:
        """All of them, to generate code of."""
        return [
            self.cost,
            self.constraints,
            self.cost_gradient,
            self.constraint_jacobian,
            self.hessian,
            self.cost_terms,
        ]


class Assembly:
    """Builds the functions of one problem from its placed elements."""

    def __init__(
        self, placed: list[Placed], linear: LinearMap, mixing: sp.csr_matrix, n_parameters: int
    ) -> None:
        self._placed = placed
        self._linear = linear
        self._mixing = mixing
        self._n_rows, self._n_sums = mixing.shape
        n_variables = linear.of_variables.shape[1]
        self._x = ca.MX.sym("x", n_variables)
        self._p = ca.MX.sym("p", n_parameters)
        self._q = (
            to_casadi(linear.of_variables) @ self._x
            + to_casadi(linear.of_parameters) @ self._p
            + ca.DM(linear.constant)
        )

    def assemble(self) -> Assembled:
        """All functions."""
        x, p = self._x, self._p
        names, terms = self._cost_terms()
        f, g = ca.sum1(terms), self._constraints()
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", self._n_rows)
        return Assembled(
            ca.Function("nlp_f", [x, p], [f], ["x", "p"], ["f"]),
            ca.Function("nlp_g", [x, p], [g], ["x", "p"], ["g"]),
            ca.Function("nlp_grad_f", [x, p], [f, self._gradient()], ["x", "p"], ["f", "grad_f_x"]),
            ca.Function("nlp_jac_g", [x, p], [g, self._jacobian()], ["x", "p"], ["g", "jac_g_x"]),
            ca.Function(
                "nlp_hess_lag",
                [x, p, lam_f, lam_g],
                [self._hessian(lam_f, lam_g)],
                ["x", "p", "lam_f", "lam_g"],
                ["triu_hess_gamma_x_x"],
            ),
            ca.Function("nlp_terms", [x, p], [terms], ["x", "p"], ["terms"]),
            names,
        )

    def _map(
        self, element: Element, label: str, output: ca.SX, *extra: tuple[ca.SX, ca.MX]
    ) -> ca.MX:
        """Dense ``output`` (n,) of all instances, (n·K,), with further inputs (SX, MX (·, K))."""
        where, inputs = element.instances, element.symbols
        arguments = [
            (inputs.quantities, _gather(self._q, where.quantities)),
            (inputs.parameters, _gather(self._p, where.parameters)),
            (inputs.constants, ca.MX(ca.DM(where.constants.T))),
            *extra,
        ]
        used = [(symbol, value) for symbol, value in arguments if symbol.numel()]
        function = ca.Function(
            f"{element.name}_{label}", [symbol for symbol, _ in used], [ca.cse(ca.densify(output))]
        )
        mapped = function.map(len(where))(*[value for _, value in used])
        return ca.vec(mapped)

    def _cost_terms(self) -> tuple[tuple[str, ...], ca.MX]:
        sums: dict[str, ca.MX] = {}
        for item in self._placed:
            element = item.element
            if element.cost_name:
                total = ca.sum1(self._map(element, "cost", element.cost))
                sums[element.cost_name] = sums.get(element.cost_name, ca.MX(0.0)) + total
        return tuple(sums), ca.vertcat(*sums.values())

    def _constraints(self) -> ca.MX:
        values, targets = [], []
        for item in self._placed:
            if item.element.rows.numel():
                values.append(self._map(item.element, "rows", item.element.rows))
                targets.append(item.rows)
        summation = self._mixing @ _summation(targets, self._n_sums)
        return to_casadi(summation) @ ca.vertcat(*values)

    def _gradient(self) -> ca.MX:
        values, targets = [], []
        for item in self._placed:
            element = item.element
            if element.cost_name:
                slope = ca.jacobian(element.cost, element.symbols.quantities).T
                values.append(self._map(element, "slope", slope))
                targets.append(element.instances.quantities)
        linear = self._linear.of_variables
        return to_casadi(linear.T @ _summation(targets, linear.shape[0])) @ ca.vertcat(*values)

    def _jacobian(self) -> ca.MX:
        values, scatters = [], []
        for item in self._placed:
            element = item.element
            if not element.rows.numel():
                continue
            jacobian = ca.jacobian(element.rows, element.symbols.quantities)
            values.append(self._map(element, "jacobian", _nonzeros(jacobian)))
            scatters.append(_scatter(jacobian, item.rows, element.instances.quantities))
        scatter = Scatter.end_to_end(scatters)
        expanded = scatter.through_rows(self._mixing).through_columns(self._linear.of_variables)
        return expanded.matrix((self._n_rows, self._x.numel()), ca.vertcat(*values))

    def _hessian(self, lam_f: ca.MX, lam_g: ca.MX) -> ca.MX:
        values, scatters = [], []
        lam_sums = to_casadi(self._mixing.T) @ lam_g
        for item in self._placed:
            element = item.element
            hessian, multipliers = _curvature(element)
            hessian = ca.triu(hessian)
            if not hessian.nnz():
                continue
            count = len(element.instances)
            extra = [(multipliers[0], ca.repmat(lam_f, 1, count))]
            if element.rows.numel():
                extra.append((multipliers[1], _gather(lam_sums, item.rows)))
            values.append(self._map(element, "hessian", _nonzeros(hessian), *extra))
            quantities = element.instances.quantities
            scatters.append(_scatter(hessian, quantities, quantities))
        # The four feet share the base's quantities: add them up before the chain rule.
        scatter, summed = Scatter.end_to_end(scatters).summed(ca.vertcat(*values))
        expanded = scatter.as_symmetric().congruent(self._linear.of_variables)
        size = self._x.numel()
        return expanded.matrix((size, size), summed)


def _curvature(element: Element) -> tuple[ca.SX, tuple[ca.SX, ca.SX]]:
    """Second derivative of λ_f·cost + λᵀrows for the solver (E27), and its multipliers."""
    q = element.symbols.quantities
    lam_f, lam = ca.SX.sym("lam_f"), ca.SX.sym("lam", element.rows.numel())
    cost = element.cost_hessian
    if cost is None:
        cost = ca.hessian(element.cost, q)[0]
    rows = ca.hessian(ca.dot(lam, element.rows), q)[0] if lam.numel() else ca.SX(*q.shape[:1] * 2)
    kept = np.ones(q.numel())
    of_quantities, _, _ = element.instances.names
    for name in element.without_curvature:
        kept[of_quantities[name]] = 0.0
    rows = ca.sparsify(rows * ca.DM(np.outer(kept, kept)))
    return lam_f * cost + rows, (lam_f, lam)


def _summation(targets: list[Indices], size: int) -> sp.csc_matrix:
    """Matrix (size, n) that adds values, laid end to end, up at their targets."""
    target = np.concatenate([part.reshape(-1) for part in targets])
    entries = (np.ones(len(target)), (target, np.arange(len(target))))
    return sp.csc_matrix(entries, shape=(size, len(target)))


def _scatter(derivative: ca.SX, rows: Indices, columns: Indices) -> Scatter:
    """Where the nonzeros of all instances go, given their rows (K, r) and columns (K, n)."""
    row, column = (np.array(part, dtype=np.intp) for part in derivative.sparsity().get_triplet())
    return Scatter(rows[:, row].reshape(-1), columns[:, column].reshape(-1))


def _nonzeros(matrix: ca.SX) -> ca.SX:
    return ca.SX(ca.Sparsity.dense(matrix.nnz(), 1), matrix.nz[:])


def _gather(vector: ca.MX, index: Indices) -> ca.MX:
    """Entries of a vector at index (K, n), as a matrix (n, K)."""
    count, size = index.shape
    if size == 0:
        return ca.MX(0, count)
    return ca.reshape(vector[index.reshape(-1).tolist()], size, count)
