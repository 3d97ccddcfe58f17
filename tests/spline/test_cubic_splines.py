"""Hermite polynomials and uniform B-splines: their defining values, and SciPy's splines."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.interpolate import BSpline, CubicHermiteSpline

from lmtr.spline import hermite
from lmtr.spline.bspline import (
    hermite_nodes,
    knot_acceleration,
    knot_value,
    knot_velocity,
    value_weights,
)

ends = arrays(float, (4, 3), elements=st.floats(-5.0, 5.0))
durations = st.floats(0.05, 2.0)
shares = st.floats(0.0, 1.0)
controls = arrays(float, (9, 2), elements=st.floats(-5.0, 5.0))


def second_derivative(u, p0, v0, p1, v1, duration):
    return hermite.cubic_curvature(u, hermite.cubic(p0, v0, p1, v1, duration), duration)


@given(ends=ends, duration=durations)
def test_a_hermite_polynomial_has_its_end_values_and_slopes(ends, duration):
    p0, v0, p1, v1 = ends
    for u, value, slope in ((0.0, p0, v0), (1.0, p1, v1)):
        np.testing.assert_allclose(hermite.value(u, *ends, duration), value, atol=1e-12)
        np.testing.assert_allclose(hermite.first_derivative(u, *ends, duration), slope, atol=1e-10)


@given(ends=ends, duration=durations, u=shares)
def test_a_hermite_polynomial_and_its_derivatives_are_those_of_scipy(ends, duration, u):
    p0, v0, p1, v1 = ends
    theirs = CubicHermiteSpline([0.0, duration], [p0, p1], [v0, v1])
    ours = (hermite.value, hermite.first_derivative, second_derivative)
    for order, function in enumerate(ours):
        expected = theirs(u * duration, order)
        np.testing.assert_allclose(
            function(u, *ends, duration), expected, rtol=1e-9, atol=1e-9 / duration**order
        )


def scipys(control, step):
    """The uniform cubic B-spline whose second control point belongs to time 0."""
    knots = step * (np.arange(len(control) + 4) - 3.0)
    return BSpline(knots, control, 3)


@given(control=controls, step=durations, u=shares, knot=st.integers(0, 5))
def test_a_b_spline_is_the_hermite_spline_on_its_nodes(control, step, u, knot):
    nodes = hermite_nodes(control, step)
    ends = (*nodes[knot], *nodes[knot + 1])
    expected = scipys(control, step)((knot + u) * step)
    np.testing.assert_allclose(hermite.value(u, *ends, step), expected, atol=1e-11)
    weighted = value_weights(u) @ control[knot : knot + 4]
    np.testing.assert_allclose(weighted, expected, atol=1e-11)


@given(control=controls, step=durations, knot=st.integers(0, 6))
def test_value_and_derivatives_at_a_knot_come_from_three_control_points(control, step, knot):
    before, at, after = control[knot : knot + 3]
    spline = scipys(control, step)
    found = (
        knot_value(before, at, after),
        knot_velocity(before, after, step),
        knot_acceleration(before, at, after, step),
    )
    for order, value in enumerate(found):
        expected = spline(knot * step, order)
        np.testing.assert_allclose(value, expected, atol=1e-11 / step**order)


@given(control=controls, step=durations, knot=st.integers(1, 5))
def test_acceleration_is_continuous_at_knots(control, step, knot):
    nodes = hermite_nodes(control, step)
    before = second_derivative(1.0, *nodes[knot - 1], *nodes[knot], step)
    after = second_derivative(0.0, *nodes[knot], *nodes[knot + 1], step)
    np.testing.assert_allclose(before, after, atol=1e-10 / step**2)
