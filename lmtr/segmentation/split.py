"""Which solutions are held out for validation: always whole ones, never single segments."""

GOLDEN_RATIO = 0.6180339887498949
"""The golden ratio's fractional part, of all numbers the furthest from any fraction."""


def in_validation(index: int, share: float) -> bool:
    """Whether the solution ``index`` is held out: a golden-ratio sequence spreads them evenly.

    The decision depends on the index alone, so a data set that grows keeps its split, and every
    stretch of indices, however short, holds close to ``share`` of them.
    """
    return (index * GOLDEN_RATIO) % 1.0 < share
