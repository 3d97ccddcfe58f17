"""Roll-pitch-yaw rotations, R = Rz(yaw)·Ry(pitch)·Rx(roll), written once for NumPy and CasADi.

The element functions take scalars or arrays and the module that owns ``sin`` and ``cos`` for
them, so that the optimizer (CasADi) and everything else (NumPy) share one formula.
"""

from typing import Any, Protocol

import numpy as np

from lmtr.arrays import Array


class Trigonometry(Protocol):
    """A namespace with the two functions that rotations need, such as ``numpy`` or ``casadi``."""

    def sin(self, x: Any, /) -> Any:  # noqa: ANN401 - a scalar, an array or a CasADi expression
        """Sine of x (rad)."""

    def cos(self, x: Any, /) -> Any:  # noqa: ANN401
        """Cosine of x (rad)."""


def rotation_rows(roll: Any, pitch: Any, yaw: Any, xp: Trigonometry) -> list[list[Any]]:  # noqa: ANN401
    """Elements of R, base to world, as three rows of three.

    Args:
        roll: Rotation about x (rad), applied first.
        pitch: Rotation about y (rad).
        yaw: Rotation about z (rad), applied last.
        xp: Namespace of ``sin`` and ``cos`` for the type of the angles.

    Returns:
        Rows of R; a vector's world components are ``R @ v_B``.
    """
    sr, cr, sp, cp, sy, cy = (
        xp.sin(roll),
        xp.cos(roll),
        xp.sin(pitch),
        xp.cos(pitch),
        xp.sin(yaw),
        xp.cos(yaw),
    )
    return [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]


def rate_rows(pitch: Any, yaw: Any, xp: Trigonometry) -> list[list[Any]]:  # noqa: ANN401
    """Elements of E with ω_W = E·(roll, pitch, yaw)˙, as three rows of three.

    Args:
        pitch: Rotation about y (rad).
        yaw: Rotation about z (rad).
        xp: Namespace of ``sin`` and ``cos``.
    """
    sp, cp, sy, cy = xp.sin(pitch), xp.cos(pitch), xp.sin(yaw), xp.cos(yaw)
    zero = 0.0 * sp
    return [[cy * cp, -sy, zero], [sy * cp, cy, zero], [-sp, zero, zero + 1.0]]


def rate_rows_derivative(
    pitch: Any,  # noqa: ANN401
    yaw: Any,  # noqa: ANN401
    pitch_rate: Any,  # noqa: ANN401
    yaw_rate: Any,  # noqa: ANN401
    xp: Trigonometry,
) -> list[list[Any]]:
    """Elements of dE/dt, so that dω_W/dt = E·rpy¨ + (dE/dt)·rpy˙ (angles rad, rates rad/s)."""
    sp, cp, sy, cy = xp.sin(pitch), xp.cos(pitch), xp.sin(yaw), xp.cos(yaw)
    zero = 0.0 * sp
    return [
        [-sy * cp * yaw_rate - cy * sp * pitch_rate, -cy * yaw_rate, zero],
        [cy * cp * yaw_rate - sy * sp * pitch_rate, -sy * yaw_rate, zero],
        [-cp * pitch_rate, zero, zero],
    ]


def _stack(rows: list[list[Any]]) -> Array:
    return np.stack([np.stack(np.broadcast_arrays(*row), axis=-1) for row in rows], axis=-2)


def rotation_matrix(rpy: Array) -> Array:
    """R, base to world, for roll-pitch-yaw angles (..., 3) in rad; returns (..., 3, 3)."""
    return _stack(rotation_rows(rpy[..., 0], rpy[..., 1], rpy[..., 2], np))


def forward_axis(rpy: Array) -> Array:
    """The base's own x axis in the world, R's first column, for angles (..., 3); (..., 3)."""
    forward_of_pitch = np.cos(rpy[..., 1])
    return np.stack(
        [
            np.cos(rpy[..., 2]) * forward_of_pitch,
            np.sin(rpy[..., 2]) * forward_of_pitch,
            -np.sin(rpy[..., 1]),
        ],
        axis=-1,
    )


def angular_velocity_W(rpy: Array, rpy_rate: Array) -> Array:
    """World angular velocity ω_W (..., 3) in rad/s from angles and their rates (..., 3)."""
    rates = _stack(rate_rows(rpy[..., 1], rpy[..., 2], np))
    return np.asarray(np.einsum("...ij,...j->...i", rates, rpy_rate))


def wrap_angle(angle: Array) -> Array:
    """Angle (rad) brought into [−π, π)."""
    wrapped = (angle + np.pi) % (2.0 * np.pi) - np.pi
    return np.where(wrapped >= np.pi, -np.pi, wrapped)  # a remainder may round up to 2π
