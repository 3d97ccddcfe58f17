"""Poses on the ground plane, SE(2), batched over leading axes."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from lmtr.arrays import Array


@dataclass(frozen=True)
class SE2:
    """A ground-plane frame seen from another one: x, y (m) and yaw (rad), each of shape (...).

    ``pose.apply(p)`` takes coordinates in this frame to the outer one; ``pose.invert()`` is the
    outer frame seen from this one; ``a @ b`` is frame b, given in a, seen from outside.
    """

    x: Array
    y: Array
    yaw: Array

    @classmethod
    def of(cls, pose: ArrayLike) -> Self:
        """A pose from an array (..., 3) of x, y (m) and yaw (rad)."""
        array = np.asarray(pose, dtype=float)
        return cls(array[..., 0], array[..., 1], array[..., 2])

    def array(self) -> Array:
        """The pose as an array (..., 3): x, y (m), yaw (rad)."""
        return np.stack(np.broadcast_arrays(self.x, self.y, self.yaw), axis=-1)

    def rotate(self, vectors: Array) -> Array:
        """Turn vectors (..., 2 or 3) by the yaw; a third component (z) is kept."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        turned = np.array(vectors, dtype=float)
        turned[..., 0] = c * vectors[..., 0] - s * vectors[..., 1]
        turned[..., 1] = s * vectors[..., 0] + c * vectors[..., 1]
        return turned

    def apply(self, points: Array) -> Array:
        """Points (..., 2 or 3) in this frame, in m, seen from the outer frame."""
        moved = self.rotate(points)
        moved[..., 0] += self.x
        moved[..., 1] += self.y
        return moved

    def invert(self) -> "SE2":
        """The outer frame seen from this one."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return SE2(-c * self.x - s * self.y, s * self.x - c * self.y, -self.yaw)

    def __matmul__(self, inner: "SE2") -> "SE2":
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return SE2(
            self.x + c * inner.x - s * inner.y,
            self.y + s * inner.x + c * inner.y,
            self.yaw + inner.yaw,
        )

    def over(self, axes: int) -> "SE2":
        """The same poses with ``axes`` trailing axes of length one, to broadcast over points."""
        index = (..., *([None] * axes))
        return SE2(
            np.asarray(self.x)[index], np.asarray(self.y)[index], np.asarray(self.yaw)[index]
        )
