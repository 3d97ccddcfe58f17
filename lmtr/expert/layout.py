"""Named blocks of a packed vector: the only place that knows where a number lies in it."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]


class Layout:
    """A vector made of named blocks, each with a shape of its own, one after the other.

    ``layout["times"]`` is the array of positions of that block's numbers, in the block's shape;
    so gathering from a packed vector is ``vector[layout["times"]]``.
    """

    def __init__(self, shapes: Mapping[str, tuple[int, ...]]) -> None:
        self._index: dict[str, Index] = {}
        begin = 0
        for name, shape in shapes.items():
            size = int(np.prod(shape))
            self._index[name] = np.arange(begin, begin + size).reshape(shape)
            begin += size
        self.size = begin

    def __getitem__(self, name: str) -> Index:
        return self._index[name]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the blocks, in packing order."""
        return tuple(self._index)

    def pack(self, blocks: Mapping[str, Array | float]) -> Array:
        """One vector (size,) from a value for every block; scalars fill their block."""
        if set(blocks) != set(self._index):
            raise ValueError(f"layout has blocks {self.names}, got {tuple(blocks)}; name them all")
        vector = np.empty(self.size)
        for name, index in self._index.items():
            vector[index] = blocks[name]
        return vector

    def unpack(self, vector: Array) -> dict[str, Array]:
        """The blocks of a vector (size,), by name and in their shapes."""
        return {name: vector[index] for name, index in self._index.items()}
