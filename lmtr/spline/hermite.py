"""Cubic Hermite polynomials, on anything that has + − × ÷ (floats, arrays, CasADi expressions)."""

from typing import Any


def cubic(p0: Any, v0: Any, p1: Any, v1: Any, duration: Any) -> tuple[Any, Any, Any, Any]:  # noqa: ANN401
    """Coefficients of 1, u, u² and u³ of a cubic in local time u in [0, 1], from its ends.

    Args:
        p0: Value at the start.
        v0: Time derivative at the start (per second).
        p1: Value at the end.
        v1: Time derivative at the end (per second).
        duration: Duration of the polynomial (s).
    """
    a = p1 - p0
    m0, m1 = v0 * duration, v1 * duration
    return p0, m0, 3.0 * a - 2.0 * m0 - m1, m0 + m1 - 2.0 * a


def cubic_value(u: Any, c: Any) -> Any:  # noqa: ANN401
    """Value at local time u of the cubic with coefficients c (4, ...)."""
    return c[0] + u * (c[1] + u * (c[2] + u * c[3]))


def cubic_slope(u: Any, c: Any, duration: Any) -> Any:  # noqa: ANN401
    """Time derivative (per second) of :func:`cubic_value`."""
    return (c[1] + u * (2.0 * c[2] + u * 3.0 * c[3])) / duration


def cubic_curvature(u: Any, c: Any, duration: Any) -> Any:  # noqa: ANN401
    """Second time derivative (per second squared) of :func:`cubic_value`."""
    return (2.0 * c[2] + u * 6.0 * c[3]) / (duration * duration)


def value(u: Any, p0: Any, v0: Any, p1: Any, v1: Any, duration: Any) -> Any:  # noqa: ANN401
    """Value at local time u of the :func:`cubic` with these ends."""
    return cubic_value(u, cubic(p0, v0, p1, v1, duration))


def first_derivative(u: Any, p0: Any, v0: Any, p1: Any, v1: Any, duration: Any) -> Any:  # noqa: ANN401
    """Time derivative (per second) of :func:`value`."""
    return cubic_slope(u, cubic(p0, v0, p1, v1, duration), duration)
