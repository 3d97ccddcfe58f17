"""Ground-plane lines (x, y, α): a point on the line (m) and its direction (rad).

The paper's obstacles are such lines, without width or end (Sec. 4.2). Arrays (..., 3).
"""

import numpy as np

from lmtr.arrays import Array
from lmtr.geometry.se2 import SE2


def signed_distance(lines: Array, points: Array) -> Array:
    """Signed distance (m) of points (..., 2 or more) to lines (..., 3), positive to the left."""
    dx = points[..., 0] - lines[..., 0]
    dy = points[..., 1] - lines[..., 1]
    return np.asarray(np.cos(lines[..., 2]) * dy - np.sin(lines[..., 2]) * dx)


def closest_distance(lines: Array, points: Array) -> Array:
    """Distance (m) of each line (n, 3) to the closest of the points (..., 2 or more), (n,).

    Infinite without points.
    """
    apart = np.abs(signed_distance(lines[:, None], points.reshape(-1, points.shape[-1])))
    return np.asarray(apart.min(axis=1, initial=np.inf))


def canonical(lines: Array) -> Array:
    """The one description of each line: the point nearest to the origin, and α in [0, π).

    Any two descriptions of the same line give the same numbers (to rounding).
    """
    x, y, alpha = lines[..., 0], lines[..., 1], lines[..., 2]
    offset = np.cos(alpha) * y - np.sin(alpha) * x
    direction = np.mod(alpha, np.pi)
    direction = np.where(direction >= np.pi, 0.0, direction)  # mod rounds −1e-17 up to π
    return np.stack([-np.sin(alpha) * offset, np.cos(alpha) * offset, direction], axis=-1)


def in_frame(lines: Array, frame: SE2) -> Array:
    """Lines (..., 3) given in the outer frame, seen from ``frame``, in canonical form."""
    inner = frame.invert()
    points = inner.apply(lines[..., :2])
    alpha = lines[..., 2] + inner.yaw
    return canonical(np.concatenate([points, alpha[..., None]], axis=-1))
