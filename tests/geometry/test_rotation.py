"""Rotations and their rates: against SciPy, by their group law and by finite differences."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from lmtr.geometry.rotation import (
    angular_velocity_W,
    forward_axis,
    rate_rows,
    rate_rows_derivative,
    rotation_matrix,
    wrap_angle,
)

angles = arrays(float, (4, 3), elements=st.floats(-3.2, 3.2))
rates = arrays(float, (4, 3), elements=st.floats(-5.0, 5.0))
STEP = 1e-6


@given(rpy=angles)
def test_a_rotation_is_orthogonal_and_that_of_scipy(rpy):
    rotation = rotation_matrix(rpy)
    product = rotation @ np.swapaxes(rotation, -1, -2)
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(3), (4, 3, 3)), atol=1e-14)
    np.testing.assert_allclose(forward_axis(rpy), rotation[..., 0], atol=1e-15)
    theirs = Rotation.from_euler("ZYX", rpy[:, ::-1]).as_matrix()
    np.testing.assert_allclose(rotation, theirs, atol=1e-14)


@given(rpy=angles, rpy_rate=rates)
def test_angular_velocity_turns_the_base_axes(rpy, rpy_rate):
    """dR/dt = ω × R, column by column."""
    ahead, behind = (rotation_matrix(rpy + sign * STEP * rpy_rate) for sign in (1.0, -1.0))
    omega = angular_velocity_W(rpy, rpy_rate)
    turned = np.cross(omega[:, None, :], np.swapaxes(rotation_matrix(rpy), -1, -2))
    change = np.swapaxes(ahead - behind, -1, -2) / (2.0 * STEP)
    np.testing.assert_allclose(change, turned, atol=1e-7)


@given(rpy=angles, rpy_rate=rates)
def test_derivative_of_the_rate_matrix_is_its_finite_difference(rpy, rpy_rate):
    for angle, rate in zip(rpy, rpy_rate, strict=True):
        ahead, behind = (
            np.array(rate_rows(*(angle + sign * STEP * rate)[1:], np)) for sign in (1.0, -1.0)
        )
        derivative = np.array(rate_rows_derivative(*angle[1:], *rate[1:], np))
        np.testing.assert_allclose((ahead - behind) / (2.0 * STEP), derivative, atol=1e-7)


@given(angle=arrays(float, (5,), elements=st.floats(-50.0, 50.0)))
def test_a_wrapped_angle_is_the_same_direction_within_half_a_turn(angle):
    wrapped = wrap_angle(angle)
    assert (wrapped >= -np.pi).all()
    assert (wrapped < np.pi).all()
    turns = (angle - wrapped) / (2.0 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-13)


def test_wrapping_keeps_its_range_where_the_remainder_rounds_up():
    assert wrap_angle(np.nextafter(-np.pi, -4.0)) == -np.pi
    assert wrap_angle(np.array(np.pi)) == -np.pi
