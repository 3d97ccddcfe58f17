"""Types of arrays in signatures; shapes, units and frames are in docstrings and names."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Quantities."""

Flags = NDArray[np.bool_]
"""Conditions."""

Indices = NDArray[np.intp]
"""Places in other arrays."""
