"""What a column of rows comes to: quantiles, means and shares, NaN where there is nothing."""

from collections.abc import Callable, Sequence
from enum import StrEnum

import numpy as np

from benchmarks.solving.rows import Row

Statistic = Callable[[Sequence[Row]], float]


class Among(StrEnum):
    """Which solves count; each but ``ALL`` is the name of a column that must be true."""

    ALL = ""
    CONVERGED = "converged"
    ACCEPTED = "accepted"


def column(rows: Sequence[Row], name: str, among: Among = Among.ALL) -> list[float]:
    """The finite or infinite values of a column; rows without it, or with NaN, are left out."""
    chosen = (row for row in rows if not among or row.get(among))
    values = (float(row.get(name, np.nan)) for row in chosen)
    return [value for value in values if not np.isnan(value)]


def quantile(name: str, q: float, among: Among = Among.ALL) -> Statistic:
    """A quantile of a column."""

    def statistic(rows: Sequence[Row]) -> float:
        values = column(rows, name, among)
        return float(np.quantile(values, q)) if values else np.nan

    return statistic


def median(name: str, among: Among = Among.ALL) -> Statistic:
    """The median of a column."""
    return quantile(name, 0.5, among)


def mean(name: str) -> Statistic:
    """The mean of a column."""

    def statistic(rows: Sequence[Row]) -> float:
        values = column(rows, name)
        return float(np.mean(values)) if values else np.nan

    return statistic


def share(name: str) -> Statistic:
    """The part of the solves for which a column is not zero."""

    def statistic(rows: Sequence[Row]) -> float:
        values = column(rows, name)
        return float(np.mean(np.array(values) != 0.0)) if values else np.nan

    return statistic


def cpu_per_accepted(rows: Sequence[Row]) -> float:
    """Processor time of all solves over the number that enter the data (s)."""
    accepted = sum(column(rows, "accepted"))
    return sum(column(rows, "cpu_s")) / accepted if accepted else np.nan


def cpu_per_iteration(rows: Sequence[Row]) -> float:
    """Median over the solves of processor time per iteration (s)."""
    return float(np.median([row["cpu_s"] / max(row["iterations"], 1) for row in rows]))


def unknown(rows: Sequence[Row]) -> float:
    """The value of a figure that rows do not tell."""
    return np.nan
