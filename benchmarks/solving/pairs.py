"""Two experts on the same tasks, compared task by task: hard tasks and a busy machine cancel out.

The median of the paired ratios comes with a percentile interval by bootstrap over tasks.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.solving.rows import Row
from lmtr.arrays import Array
from lmtr.streams import Purpose, stream

RESAMPLES = 4000
LEVEL = 0.95


@dataclass(frozen=True)
class PairedRatio:
    """Median over tasks of a figure of one expert over that of the other.

    Attributes:
        median: The ratio.
        low: Lower end of its 95 % interval.
        high: Upper end.
        pairs: Tasks that it was taken from.
    """

    median: float
    low: float
    high: float
    pairs: int


def paired_ratio(ours: Array, theirs: Array, seed: int) -> PairedRatio:
    """Compare two figures of the same tasks, (n,) each and positive; ``seed`` is the draws'."""
    if len(ours) == 0:
        return PairedRatio(np.nan, np.nan, np.nan, 0)
    quotients = np.asarray(ours, dtype=float) / np.asarray(theirs, dtype=float)
    draws = stream(seed, Purpose.BOOTSTRAP).integers(len(ours), size=(RESAMPLES, len(ours)))
    medians = np.median(quotients[draws], axis=-1)
    low, high = np.quantile(medians, [(1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0])
    return PairedRatio(float(np.median(quotients)), float(low), float(high), len(ours))


def compare(
    ours: Sequence[Row], theirs: Sequence[Row], seed: int, *, same_costs: bool
) -> dict[str, PairedRatio]:
    """Ratios of time over all tasks, and of time, iterations and cost where both have converged.

    Args:
        ours: Rows of this expert.
        theirs: Rows of the other one, for the same tasks.
        seed: Seed of the bootstrap draws.
        same_costs: Whether both mean the same by a cost.
    """
    pairs = list(zip(ours, theirs, strict=True))
    both = [(a, b) for a, b in pairs if a["converged"] and b["converged"]]

    def ratio_of(column: str, among: Sequence[tuple[Row, Row]]) -> PairedRatio:
        found = [(a[column], b[column]) for a, b in among if a[column] > 0 and b[column] > 0]
        columns = np.array(found, dtype=float).reshape(-1, 2)
        return paired_ratio(columns[:, 0], columns[:, 1], seed)

    ratios = {
        "CPU": ratio_of("cpu_s", pairs),
        "CPU, both converged": ratio_of("cpu_s", both),
        "iterations, both converged": ratio_of("iterations", both),
    }
    if same_costs:
        ratios["cost, both converged"] = ratio_of("cost", both)
    return ratios
