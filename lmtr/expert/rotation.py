"""Rotations of :mod:`lmtr.geometry.rotation` as CasADi matrices of roll, pitch and yaw."""

import casadi as ca

from lmtr.geometry.rotation import rate_rows, rate_rows_derivative, rotation_rows


def rotation_matrix(rpy: ca.SX) -> ca.SX:
    """Base to world, (3, 3)."""
    roll, pitch, yaw = ca.vertsplit(rpy)
    return _matrix(rotation_rows(roll, pitch, yaw, ca))


def rate_matrix(rpy: ca.SX) -> ca.SX:
    """From the rates of roll, pitch, yaw to the angular velocity in world axes, (3, 3)."""
    _, pitch, yaw = ca.vertsplit(rpy)
    return _matrix(rate_rows(pitch, yaw, ca))


def rate_matrix_derivative(rpy: ca.SX, rate: ca.SX) -> ca.SX:
    """Time derivative of :func:`rate_matrix`, (3, 3)."""
    _, pitch, yaw = ca.vertsplit(rpy)
    _, pitch_rate, yaw_rate = ca.vertsplit(rate)
    return _matrix(rate_rows_derivative(pitch, yaw, pitch_rate, yaw_rate, ca))


def _matrix(rows: list[list[ca.SX]]) -> ca.SX:
    return ca.vertcat(*[ca.horzcat(*row) for row in rows])
