"""Forces and foot positions at a given time without look-ups: C¹ in time and in contact times.

A phase's polynomials are evaluated at local times clipped to [0, 1] (E7), so that each holds its
start value before and its end value after it. Sums of such increments need no branch on where a
sample lies, which an optimizer whose contact times are free must not have; and a sample that cannot
meet a phase within the timing windows leaves it out, which is the problem's sparsity.
"""

from typing import Any

import casadi as ca

from lmtr.spline import hermite
from lmtr.trajectory.trajectory import FORCE_PIECES


def clipped(u: Any) -> Any:  # noqa: ANN401 - a float or a CasADi expression
    """Local time held in [0, 1] (E7)."""
    return ca.fmin(ca.fmax(u, 0.0), 1.0)


def stance_force(time: Any, begin: Any, end: Any, points: list[Any]) -> Any:  # noqa: ANN401
    """Force at ``time`` of the stance from ``begin`` to ``end``, in the unit of its points (E8).

    Args:
        time: Time (s).
        begin: Touch-down (s).
        end: Lift-off (s).
        points: The six Bézier points of the two cubics but for their shared one, which is the
            mean of its neighbours (the force is C¹): three of the first, three of the second.
    """
    s = FORCE_PIECES * (time - begin) / (end - begin)
    p0, p1, before, after, p5, p6 = points
    middle, slope = 0.5 * (before + after), 1.5 * (after - before)
    rise = hermite.value(clipped(s), p0, 3.0 * (p1 - p0), middle, slope, 1.0)
    fall = hermite.value(clipped(s - 1.0), middle, slope, p6, 3.0 * (p6 - p5), 1.0)
    return rise + fall - middle


def swing_displacement(
    time: Any,  # noqa: ANN401
    liftoff: Any,  # noqa: ANN401
    touchdown: Any,  # noqa: ANN401
    here: Any,  # noqa: ANN401
    middle: Any,  # noqa: ANN401
    slope: Any,  # noqa: ANN401
    there: Any,  # noqa: ANN401
) -> Any:  # noqa: ANN401
    """Way (m) that a swing has covered at ``time``, from zero to ``there`` − ``here`` (E9).

    Args:
        time: Time (s).
        liftoff: Start of the swing (s).
        touchdown: End of the swing (s).
        here: Foothold before it (m).
        middle: Position half-way in time (m).
        slope: Velocity half-way, times half the duration (m).
        there: Foothold after it (m).
    """
    s = 2.0 * (time - liftoff) / (touchdown - liftoff)
    rise = hermite.value(clipped(s), here, 0.0, middle, slope, 1.0)
    fall = hermite.value(clipped(s - 1.0), middle, slope, there, 0.0, 1.0)
    return rise - here + fall - middle
