"""Branch-free forces and swings: they agree with look-ups and are smooth at contact changes."""

import casadi as ca
import numpy as np
import pytest

from lmtr.expert.gating import stance_force, swing_displacement
from lmtr.spline import hermite

BEGIN, END = 0.4, 1.3
POINTS = [0.0, 0.0, 0.7, 0.5, 0.0, 0.0]


def force(time, begin=BEGIN, end=END, points=POINTS):
    return float(ca.DM(stance_force(ca.DM(time), begin, end, points)))


@pytest.mark.parametrize("time", [-1.0, 0.0, BEGIN, END, 2.0, 9.0])
def test_a_swinging_foot_pushes_exactly_nothing(time):
    assert force(time) == pytest.approx(0.0, abs=1e-15)


def test_force_is_the_bernstein_sum_of_its_points():
    for u in (0.1, 0.5, 0.9):
        bernstein = np.array([(1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u**2 * (1 - u), u**3])
        half = (END - BEGIN) / 2
        rise = bernstein @ [0.0, 0.0, 0.7, 0.6]
        fall = bernstein @ [0.6, 0.5, 0.0, 0.0]
        assert force(BEGIN + u * half) == pytest.approx(rise)
        assert force(BEGIN + (1 + u) * half) == pytest.approx(fall)


@pytest.mark.parametrize("change", [BEGIN, END])
def test_force_has_no_slope_at_contact_changes(change):
    step = 1e-4
    assert abs(force(change + step) - force(change - step)) < 1e-6


@pytest.mark.parametrize(("time", "expected"), [(0.0, 0.0), (0.5, 0.0), (0.9, 0.4), (3.0, 0.4)])
def test_swing_begins_and_ends_at_its_footholds(time, expected):
    way = swing_displacement(ca.DM(time), 0.5, 0.9, 1.0, 1.25, 0.3, 1.4)
    assert float(ca.DM(way)) == pytest.approx(expected)


def test_swing_passes_its_middle_at_half_time():
    way = swing_displacement(ca.DM(0.7), 0.5, 0.9, 1.0, 1.25, 0.3, 1.4)
    assert 1.0 + float(ca.DM(way)) == pytest.approx(1.25)
    quarter = swing_displacement(ca.DM(0.6), 0.5, 0.9, 1.0, 1.25, 0.3, 1.4)
    assert 1.0 + float(ca.DM(quarter)) == pytest.approx(
        hermite.value(0.5, 1.0, 0.0, 1.25, 0.3 / 0.2, 0.2)
    )
