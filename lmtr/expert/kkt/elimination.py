"""Symbolic factorization (E33): in which order to eliminate, and what is computed together.

The order is that of minimum degree. Neighbouring columns whose fill is alike are eliminated
together as the pivots of a *front*, a dense matrix over the pivots and the rows that they touch
(their *border*); merging a few more than are alike trades arithmetic, which is cheap in dense
blocks, for copying between fronts.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from lmtr.arrays import Array, Indices

MAX_PIVOTS = 64
"""Most pivots of a front; their block stays in the fastest cache."""

COPY = 40.0
"""Time to hand an entry from front to front, over that of a multiply-add in a dense block."""

PER_FRONT = 10_000.0
"""Time that a front takes for itself, likewise."""


@dataclass(frozen=True)
class Front:
    """Columns that are eliminated together.

    Attributes:
        first: First pivot, in the order of elimination.
        pivots: How many there are.
        border: Rows below the pivots, ascending.
    """

    first: int
    pivots: int
    border: Indices

    @property
    def rows(self) -> int:
        """Size of the dense matrix."""
        return self.pivots + len(self.border)


@dataclass(frozen=True)
class Elimination:
    """Order and fronts.

    Attributes:
        order: Which unknown is eliminated when, (N,).
        fronts: In the order of elimination; a front comes after all that it needs.
    """

    order: Indices
    fronts: list[Front]

    @property
    def parents(self) -> list[int]:
        """Front that each front's border goes to; −1 for none."""
        front_of = np.repeat(np.arange(len(self.fronts)), [f.pivots for f in self.fronts])
        return [int(front_of[f.border[0]]) if len(f.border) else -1 for f in self.fronts]


def eliminate(pattern: sp.csc_matrix) -> Elimination:
    """Plan the factorization of matrices with a symmetric pattern (both triangles, (N, N))."""
    order = _minimum_degree(pattern)
    borders = _borders(pattern, order)
    order = order[_postorder(borders)]
    return Elimination(order, _merged(_borders(pattern, order)))


def _minimum_degree(pattern: sp.csc_matrix) -> Indices:
    """SciPy's sparse LU finds the order of multiple minimum degree; its factors are not needed."""
    size = pattern.shape[0]
    values = sp.csc_matrix(pattern, dtype=np.float64, copy=True)
    values.data[:] = -1.0
    dominant = sp.csc_matrix(values + 2.0 * size * sp.identity(size))
    options = {"SymmetricMode": True}
    factors = spl.splu(dominant, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    return np.asarray(np.argsort(factors.perm_c))


def _borders(pattern: sp.csc_matrix, order: Indices) -> list[Indices]:
    """Rows below the diagonal of every column of the factor, in the order of elimination."""
    permuted = sp.csc_matrix(pattern[order][:, order])
    touching: list[list[Indices]] = [[] for _ in order]
    borders = []
    for column in range(len(order)):
        own = permuted.indices[permuted.indptr[column] : permuted.indptr[column + 1]]
        rows = np.unique(np.concatenate([own, *touching[column]]))
        border = rows[rows > column]
        borders.append(border)
        if len(border):
            touching[border[0]].append(border)
    return borders


def _postorder(borders: list[Indices]) -> Indices:
    """Columns so that all that one needs come right before it, the largest first.

    So few intermediate results wait at a time, and small ones are next to what they merge with.
    """
    children: list[list[int]] = [[] for _ in borders]
    roots: list[int] = []
    for column, border in enumerate(borders):
        (children[border[0]] if len(border) else roots).append(column)
    visited: list[int] = []
    waiting = roots
    while waiting:  # from the roots down, which is the reverse of the order wanted
        column = waiting.pop()
        visited.append(column)
        waiting.extend(sorted(children[column], key=lambda child: -len(borders[child])))
    return np.array(visited[::-1], dtype=np.intp)


def _merged(borders: list[Indices]) -> list[Front]:
    """Fronts: a column joins the front of the column before it where that does not cost time."""
    fronts: list[Front] = []
    for column, border in enumerate(borders):
        front = Front(column, 1, border)
        while fronts and _is_parent(front, fronts[-1]) and _pays(fronts[-1], front):
            child = fronts.pop()
            front = Front(child.first, child.pivots + front.pivots, front.border)
        fronts.append(front)
    return fronts


def _is_parent(front: Front, before: Front) -> bool:
    return len(before.border) > 0 and before.border[0] < front.first + front.pivots


def _pays(child: Front, parent: Front) -> bool:
    pivots = child.pivots + parent.pivots
    apart = _time(child.pivots, child.rows) + _time(parent.pivots, parent.rows)
    return pivots <= MAX_PIVOTS and _time(pivots, child.pivots + parent.rows) <= apart


def _time(pivots: int, rows: int) -> float:
    """Time of a front, in multiply-adds."""
    heights: Array = np.arange(rows - pivots, rows, dtype=np.float64)
    border = rows - pivots
    work: Any = (heights**2).sum()
    return 0.5 * float(work) + 0.5 * COPY * border**2 + PER_FRONT
