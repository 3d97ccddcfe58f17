"""The check that every table of tasks, segments or modes passes before it is used."""

import numpy as np
from numpy.typing import ArrayLike

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.vectors.layout import Layout


def finite_rows(name: str, rows: ArrayLike, layout: Layout) -> Array:
    """A table (B, layout.size) as float64.

    Args:
        name: What the rows are, for the message.
        rows: The table.
        layout: Layout of each row.

    Raises:
        DataError: It is no table, its rows are of another layout, or a number is not finite.
    """
    array = np.asarray(rows, dtype=np.float64)
    if array.ndim != 2:
        raise DataError(
            f"{name} must be a table of shape (rows, {layout.size}), got shape {array.shape}; "
            "give a single vector as one row"
        )
    try:
        return layout.require_finite(array)
    except DataError as error:
        raise DataError(f"{name}: {error}") from error
