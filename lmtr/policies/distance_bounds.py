"""Lower bounds of L1 distances, many times cheaper than the distances themselves.

For a partition of the dimensions into groups g with signs sᵢ = ±1,

    Σᵢ |xᵢ − x′ᵢ|  ≥  Σ_g |Σ_{i∈g} sᵢ·(xᵢ − x′ᵢ)|,

so the L1 distance of a few signed sums never exceeds the true one. Where dimensions of a group
vary together, as a walking robot's do, it falls little short of it: with 12 sums of the 35
dimensions of a task about 60 of 25,000 tasks have a bound below the distance of the nearest one.
The sums are rounded to 16 bits, of which the processor takes 32 at a time.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lmtr.arrays import Array

GROUPS = 12
"""Signed sums; with fewer more rows pass, with more each row costs more."""

TILE = 12_500
"""Rows taken at once, so that what lies in between stays in the processor's cache."""

SAMPLE = 2000
"""Rows from which the groups are chosen, and that are rounded at once. What is chosen decides about
speed alone."""

LARGEST = int(np.iinfo(np.int16).max)

Bounds = NDArray[np.int16]
"""Lower bounds in units of a step of rounding."""


class DistanceBounds:
    """Rows of a library, to be bounded away from.

    Args:
        rows: (N, D), N ≥ 1, scaled so that their distance is a plain L1 norm.
    """

    def __init__(self, rows: NDArray[np.float32]) -> None:
        self._sums = signed_sums(rows[:: max(1, len(rows) // SAMPLE)], GROUPS)
        # Twice, a part at a time, for all sums at once would take more memory than what is kept.
        low, high = np.full(self._sums.shape[1], np.inf), np.full(self._sums.shape[1], -np.inf)
        for sums in self._parts(rows):
            low, high = np.minimum(low, sums.min(axis=0)), np.maximum(high, sums.max(axis=0))
        # Queries are cut off half the rows' width beyond them, which only lowers bounds.
        width = high - low
        self._low, self._high = low - 0.5 * width, high + 0.5 * width
        # Each rounded sum differs by at most 1.5 widths, and all of them must add up to 16 bits.
        self._step = float(1.5 * width.sum() / (LARGEST - 2 * len(low))) or 1.0
        # Memory for what lies in between, kept because the system's would be new to each call and
        # double its time; one for each thread that has looked something up at the same time.
        self._spare: list[Bounds] = []
        # The codes of a group lie next to each other in memory.
        self._codes = np.empty((len(low), len(rows)), dtype=np.int16)
        for part, sums in enumerate(self._parts(rows)):
            self._codes[:, part * SAMPLE : (part + 1) * SAMPLE] = self._rounded(sums).T

    @property
    def nbytes(self) -> int:
        """Memory of the rounded sums (bytes)."""
        return self._codes.nbytes

    def of(self, query: NDArray[np.float32]) -> Bounds:
        """Bounds (N,) of the distances from ``query`` (D,) to all rows."""
        groups, rows = self._codes.shape
        code = self._rounded(query @ self._sums)[:, None]
        bounds = np.empty(rows, dtype=np.int16)
        try:
            scratch = self._spare.pop()
        except IndexError:
            scratch = np.empty((groups, min(TILE, rows)), dtype=np.int16)
        for start in range(0, rows, TILE):
            tile = self._codes[:, start : start + TILE]
            apart = scratch[:, : tile.shape[1]]
            np.subtract(tile, code, out=apart)
            np.abs(apart, out=apart)
            np.add.reduce(apart, axis=0, dtype=np.int16, out=bounds[start : start + TILE])
        self._spare.append(scratch)
        return bounds

    def highest(self, distance: float) -> int:
        """The greatest bound that a row at ``distance`` or nearer can have."""
        # Each sum is rounded by up to half a step on either side.
        return min(int(distance / self._step) + len(self._codes) + 2, LARGEST)

    def _parts(self, rows: NDArray[np.float32]) -> Iterator[Array]:
        """Signed sums (some, G) of the rows, in their order."""
        for start in range(0, len(rows), SAMPLE):
            yield rows[start : start + SAMPLE] @ self._sums

    def _rounded(self, sums: Array) -> NDArray[np.int16]:
        """Sums (..., G) cut off and in steps from the lowest."""
        cut_off = np.minimum(np.maximum(sums, self._low), self._high)
        codes: Bounds = np.rint((cut_off - self._low) / self._step).astype(np.int16)
        return codes


def signed_sums(rows: NDArray[np.float32], count: int) -> Array:
    """Groups of dimensions that vary together, as signs (D, G) of their sums, 0 outside of them.

    Beginning with each dimension by itself, the two sums are joined, with the better sign, that
    lose least of their standard deviations by it, until ``count`` are left.
    """
    signs = np.eye(rows.shape[1])
    covariance = np.atleast_2d(np.cov(rows.T.astype(np.float64), bias=True))
    while len(signs) > count:
        among = signs @ covariance @ signs.T
        variance = np.maximum(np.diag(among), 0.0)
        spread = np.sqrt(variance)
        joint = np.sqrt(variance[:, None] + variance + 2.0 * np.abs(among))
        loss = spread[:, None] + spread - joint
        np.fill_diagonal(loss, np.inf)
        one, other = sorted(divmod(int(loss.argmin()), len(loss)))
        signs[one] += np.copysign(signs[other], signs[other] * among[one, other])
        signs = np.delete(signs, other, axis=0)
    return np.ascontiguousarray(signs.T)
