"""What a solve can come to: the words that the expert says and the filter judges."""

from enum import StrEnum


class Status(StrEnum):
    """Outcome of a solve."""

    CONVERGED = "converged"
    ITERATION_LIMIT = "iteration_limit"
    TIME_LIMIT = "time_limit"
    INFEASIBLE = "infeasible"
    DIVERGED = "diverged"
    ERROR = "error"
