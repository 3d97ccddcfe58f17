"""Cubic Hermite polynomials, on anything that has + − × ÷ (floats, arrays, CasADi expressions)."""

from typing import Any


def value(u: Any, p0: Any, v0: Any, p1: Any, v1: Any, duration: Any) -> Any:  # noqa: ANN401
    """Value at local time u in [0, 1] of the cubic with end values p and end slopes v.

    Args:
        u: Local time, 0 at the start and 1 at the end of the polynomial.
        p0: Value at the start.
        v0: Time derivative at the start (per second).
        p1: Value at the end.
        v1: Time derivative at the end (per second).
        duration: Duration of the polynomial (s).
    """
    a = p1 - p0
    m0, m1 = v0 * duration, v1 * duration
    return p0 + u * (m0 + u * ((3.0 * a - 2.0 * m0 - m1) + u * (m0 + m1 - 2.0 * a)))


def first_derivative(u: Any, p0: Any, v0: Any, p1: Any, v1: Any, duration: Any) -> Any:  # noqa: ANN401
    """Time derivative (per second) of :func:`value`."""
    a = p1 - p0
    m0, m1 = v0 * duration, v1 * duration
    slope = m0 + u * (2.0 * (3.0 * a - 2.0 * m0 - m1) + u * 3.0 * (m0 + m1 - 2.0 * a))
    return slope / duration


def second_derivative(u: Any, p0: Any, v0: Any, p1: Any, v1: Any, duration: Any) -> Any:  # noqa: ANN401
    """Second time derivative (per second squared) of :func:`value`."""
    a = p1 - p0
    m0, m1 = v0 * duration, v1 * duration
    curvature = 2.0 * (3.0 * a - 2.0 * m0 - m1) + u * 6.0 * (m0 + m1 - 2.0 * a)
    return curvature / (duration * duration)
