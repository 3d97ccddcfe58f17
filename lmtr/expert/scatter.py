"""Where the values of many small derivatives go in one large sparse matrix."""

import casadi as ca
import numpy as np
import scipy.sparse as sp

from lmtr.arrays import Array, Indices


class Scatter:
    """Where each value of a long vector goes in a sparse matrix, and with which factor.

    Stored as one entry per contribution: (row, column) += factor · value[source].
    """

    def __init__(
        self,
        rows: Indices,
        columns: Indices,
        source: Indices | None = None,
        factor: Array | None = None,
    ) -> None:
        self.rows, self.columns = rows, columns
        self.source = np.arange(len(rows)) if source is None else source
        self.factor = np.ones(len(rows)) if factor is None else factor

    @classmethod
    def end_to_end(cls, parts: "list[Scatter]") -> "Scatter":
        """One scatter of the values of several plain ones, laid end to end."""
        return cls(
            np.concatenate([part.rows for part in parts]),
            np.concatenate([part.columns for part in parts]),
        )

    def through_columns(self, linear: sp.csr_matrix) -> "Scatter":
        """M ↦ M·C (E26)."""
        count = np.diff(linear.indptr)[self.columns]
        entry = np.repeat(np.arange(len(self.rows)), count)
        begin = np.repeat(linear.indptr[self.columns], count)
        within = np.arange(len(entry)) - np.repeat(np.cumsum(count) - count, count)
        place = begin + within
        return Scatter(
            self.rows[entry],
            linear.indices[place].astype(np.intp),
            self.source[entry],
            self.factor[entry] * linear.data[place],
        )

    def through_rows(self, mixing: sp.csr_matrix) -> "Scatter":
        """M ↦ A·M."""
        return self.transposed().through_columns(mixing.T.tocsr()).transposed()

    def transposed(self) -> "Scatter":
        """Mᵀ."""
        return Scatter(self.columns, self.rows, self.source, self.factor)

    def as_symmetric(self) -> "Scatter":
        """Both triangles of a symmetric matrix given by one."""
        off = self.rows != self.columns
        return Scatter(
            np.concatenate([self.rows, self.columns[off]]),
            np.concatenate([self.columns, self.rows[off]]),
            np.concatenate([self.source, self.source[off]]),
            np.concatenate([self.factor, self.factor[off]]),
        )

    def congruent(self, linear: sp.csr_matrix) -> "Scatter":
        """Upper triangle of Cᵀ·M·C (E27)."""
        both = self.through_columns(linear).transposed().through_columns(linear)
        upper = both.rows <= both.columns
        return Scatter(
            both.rows[upper], both.columns[upper], both.source[upper], both.factor[upper]
        )

    def summed(self, values: ca.MX) -> tuple["Scatter", ca.MX]:
        """Contributions to one place added up: a scatter of as many values as places."""
        height = int(self.rows.max()) + 1
        places, nonzero = np.unique(self.columns * height + self.rows, return_inverse=True)
        weights = sp.csc_matrix(
            (self.factor, (nonzero, self.source)), shape=(len(places), values.numel())
        )
        weights.sum_duplicates()
        columns, rows = np.divmod(places, height)
        return Scatter(rows, columns), to_casadi(weights) @ values

    def matrix(self, shape: tuple[int, int], values: ca.MX) -> ca.MX:
        """The sparse matrix of ``values``, contributions to one place added up."""
        places, nonzeros = self.summed(values)  # column by column, as CasADi stores them
        pattern = ca.Sparsity.triplet(*shape, places.rows.tolist(), places.columns.tolist())
        return ca.MX(pattern, nonzeros)


def to_casadi(matrix: sp.spmatrix) -> ca.DM:
    """A SciPy sparse matrix for CasADi."""
    compressed = sp.csc_matrix(matrix)
    compressed.sort_indices()
    pattern = ca.Sparsity(
        int(compressed.shape[0]),
        int(compressed.shape[1]),
        compressed.indptr.tolist(),
        compressed.indices.tolist(),
    )
    return ca.DM(pattern, compressed.data)
