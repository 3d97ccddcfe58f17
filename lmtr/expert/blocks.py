"""Named blocks of the expert's vectors: variables, parameters, quantities, rows.

They live and die with one problem, unlike the layouts of :mod:`lmtr.vectors`, which are contracts
stored with data and models.
"""

from collections.abc import Mapping

import numpy as np

from lmtr.arrays import Array, Indices
from lmtr.errors import DataError


class Blocks:
    """A vector made of named blocks, each with a shape of its own, one after the other.

    ``blocks["times"]`` is the array of positions of that block's numbers, in the block's shape;
    so gathering from a packed vector is ``vector[blocks["times"]]``.
    """

    def __init__(self, shapes: Mapping[str, tuple[int, ...]]) -> None:
        self._index: dict[str, Indices] = {}
        begin = 0
        for name, shape in shapes.items():
            size = int(np.prod(shape))
            self._index[name] = np.arange(begin, begin + size).reshape(shape)
            begin += size
        self.size = begin

    def __getitem__(self, name: str) -> Indices:
        if name not in self._index:
            raise DataError(f"blocks: none is called {name!r}; choose one of {self.names}")
        return self._index[name]

    def __contains__(self, name: str) -> bool:
        return name in self._index

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the blocks, in packing order."""
        return tuple(self._index)

    def shapes(self, *names: str) -> dict[str, tuple[int, ...]]:
        """Shapes of some blocks, for others that repeat them."""
        return {name: self[name].shape for name in names}

    def pack(self, values: Mapping[str, Array | float]) -> Array:
        """One vector (size,) from a value for every block; scalars fill their block.

        Raises:
            DataError: A block has no value, or a value has no block.
        """
        if set(values) != set(self._index):
            raise DataError(
                f"blocks: each of {self.names} needs a value, got {tuple(values)}; name them all"
            )
        vector = np.empty(self.size)
        for name, index in self._index.items():
            vector[index] = values[name]
        return vector

    def unpack(self, vector: Array) -> dict[str, Array]:
        """The blocks of a vector (size,), by name and in their shapes."""
        return {name: vector[index] for name, index in self._index.items()}
