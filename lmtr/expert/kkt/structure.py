"""What is known of a Newton step before any value is: the structure of its linear system.

With Hessian H, Jacobians J_c of equalities and J_d of inequalities, and slacks s of the latter,
IPOPT solves (E30)

    [ H + Σ_x        J_cᵀ   J_dᵀ ] [ Δx  ]
    [         Σ_s            −I  ] [ Δs  ]
    [ J_c           −δ_c         ] [ y_c ]   = r.
    [ J_d     −I            −δ_d ] [ y_d ]

Slacks and y_d can be eliminated one row at a time (E31), which adds J_dᵀ P J_d to H with a diagonal
P = (Σ_s⁻¹ + δ_d)⁻¹. What is left, the condensed system in (x, y_c) (E32), is a quarter of the size
and hardly denser, for rows of one sample and foot couple variables that the Hessian couples anyway.
"""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
import scipy.sparse as sp

from lmtr.arrays import Indices
from lmtr.expert.formulation import Formulation

MAX_GROUP = 8
"""Most rows of J_d that are eliminated at a time."""


@dataclass(frozen=True)
class RowGroup:
    """Rows of J_d next to each other that have nonzeros in the same columns, or some of these.

    Attributes:
        rows: First row, and the one after the last.
        columns: Columns, ascending.
    """

    rows: tuple[int, int]
    columns: Indices


@dataclass(frozen=True)
class KktStructure:
    """Patterns of the blocks; stored values are all ones.

    Attributes:
        hessian: H with both triangles and its whole diagonal, (n, n).
        equalities: J_c, (n_c, n).
        inequalities: J_d, (n_d, n).
    """

    hessian: sp.csr_matrix
    equalities: sp.csr_matrix
    inequalities: sp.csr_matrix

    @classmethod
    def of(cls, problem: Formulation) -> "KktStructure":
        """The structure of a problem none of whose variables is fixed."""
        triangle = _pattern(problem.functions.hessian.sparsity_out(0))
        rows = _pattern(problem.functions.constraint_jacobian.sparsity_out(1))
        is_equality = problem.rows_lower == problem.rows_upper
        whole = _ones(triangle + triangle.T + sp.identity(triangle.shape[0]))
        return cls(whole, rows[is_equality], rows[~is_equality])

    @property
    def size(self) -> int:
        """Unknowns of the whole system, in the order x, s, y_c, y_d."""
        return self.n_variables + self.n_equalities + 2 * self.n_inequalities

    @property
    def n_variables(self) -> int:
        """Variables x."""
        return int(self.hessian.shape[0])

    @property
    def n_equalities(self) -> int:
        """Equalities, with multipliers y_c."""
        return int(self.equalities.shape[0])

    @property
    def n_inequalities(self) -> int:
        """Inequalities, with slacks s and multipliers y_d."""
        return int(self.inequalities.shape[0])

    @cached_property
    def groups(self) -> list[RowGroup]:
        """The rows of J_d in groups that can be eliminated together at no fill of their own."""
        groups: list[tuple[int, set[int]]] = []
        pointers, indices = self.inequalities.indptr, self.inequalities.indices
        for row in range(self.n_inequalities):
            columns = set(indices[pointers[row] : pointers[row + 1]].tolist())
            if groups:
                first, shared = groups[-1]
                nested = columns <= shared or shared <= columns
                if nested and row - first < MAX_GROUP:
                    groups[-1] = (first, columns | shared)
                    continue
            groups.append((row, columns))
        ends = [first for first, _ in groups[1:]] + [self.n_inequalities]
        return [
            RowGroup((first, end), np.array(sorted(columns), dtype=np.intp))
            for (first, columns), end in zip(groups, ends, strict=True)
        ]

    @cached_property
    def condensed(self) -> sp.csc_matrix:
        """Pattern of the condensed system (E32), both triangles, in the order x, y_c."""
        counts = [len(group.columns) for group in self.groups]
        columns = np.concatenate([np.empty(0, np.intp), *(group.columns for group in self.groups)])
        rows = np.repeat(np.arange(len(counts)), counts)
        shape = (len(counts), self.n_variables)
        cliques = sp.csr_matrix((np.ones(len(rows)), (rows, columns)), shape=shape)
        corner = sp.identity(self.n_equalities)
        blocks = [
            [self.hessian + cliques.T @ cliques, self.equalities.T],
            [self.equalities, corner],
        ]
        return _ones(sp.bmat(blocks)).tocsc()


def _pattern(sparsity: ca.Sparsity) -> sp.csr_matrix:
    rows, columns = (np.array(part, dtype=np.intp) for part in sparsity.get_triplet())
    return _ones(sp.csr_matrix((np.ones(len(rows)), (rows, columns)), shape=sparsity.shape))


def _ones(matrix: sp.spmatrix) -> sp.csr_matrix:
    pattern = sp.csr_matrix(matrix, dtype=np.float64, copy=True)
    pattern.data[:] = 1.0
    pattern.sort_indices()
    return pattern
