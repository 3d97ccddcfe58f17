"""Uniform cubic B-splines: C² by construction, and exactly a Hermite spline at the knots.

With control points c₋, c, c₊ around a knot and knot spacing h, the spline has there the value
(c₋ + 4c + c₊)/6, the velocity (c₊ − c₋)/(2h) and the acceleration (c₋ − 2c + c₊)/h². So no
constraint is needed to make a base trajectory's acceleration continuous.
"""

from typing import Any

import numpy as np

from lmtr.arrays import Array


def knot_value(before: Any, at: Any, after: Any) -> Any:  # noqa: ANN401 - arrays or CasADi
    """Value at a knot from its three control points."""
    return (before + 4.0 * at + after) / 6.0


def knot_velocity(before: Any, after: Any, step: float) -> Any:  # noqa: ANN401
    """Time derivative at a knot (per second) for knots ``step`` seconds apart."""
    return (after - before) / (2.0 * step)


def knot_acceleration(before: Any, at: Any, after: Any, step: float) -> Any:  # noqa: ANN401
    """Second time derivative at a knot (per second squared)."""
    return (before - 2.0 * at + after) / (step * step)


def value_weights(u: float) -> Array:
    """Weights (4,) of four consecutive control points at local time u in [0, 1] between knots."""
    return (
        np.array(
            [
                (1.0 - u) ** 3,
                3.0 * u**3 - 6.0 * u**2 + 4.0,
                -3.0 * u**3 + 3.0 * u**2 + 3.0 * u + 1.0,
                u**3,
            ]
        )
        / 6.0
    )


def velocity_weights(u: float, step: float) -> Array:
    """Like :func:`value_weights`, for the time derivative (per second)."""
    return np.array(
        [-((1.0 - u) ** 2), 3.0 * u**2 - 4.0 * u, -3.0 * u**2 + 2.0 * u + 1.0, u**2]
    ) / (2.0 * step)


def acceleration_weights(u: float, step: float) -> Array:
    """Like :func:`value_weights`, for the second time derivative (per second squared)."""
    return np.array([1.0 - u, 3.0 * u - 2.0, 1.0 - 3.0 * u, u]) / (step * step)


def sampled(control: Array, per_knot: int) -> Array:
    """Values ((N − 1)·per_knot + 1, D) of N + 2 control points (N + 2, D), from knot to knot."""
    weights = np.stack([value_weights(part / per_knot) for part in range(per_knot)])
    neighbours = np.lib.stride_tricks.sliding_window_view(control, 4, axis=0)  # (N − 1, D, 4)
    values = np.moveaxis(neighbours @ weights.T, -1, 1).reshape(-1, control.shape[1])
    return np.concatenate([values, knot_value(*control[-3:])[None]])


def hermite_nodes(control: Array, step: float) -> Array:
    """Hermite nodes (N, 2, D) — value, time derivative — of N + 2 control points (N + 2, D)."""
    before, at, after = control[:-2], control[1:-1], control[2:]
    return np.stack([knot_value(before, at, after), knot_velocity(before, after, step)], axis=1)
