"""Lines: one description for all ways to say the same line, in every frame."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lmtr.geometry.line import canonical, closest_distance, in_frame, signed_distance
from lmtr.geometry.se2 import SE2

places = arrays(float, (6, 2), elements=st.floats(-5.0, 5.0))
directions = arrays(float, (6,), elements=st.floats(-7.0, 7.0))
shifts = arrays(float, (6,), elements=st.floats(-10.0, 10.0))
frames = arrays(float, (3,), elements=st.floats(-5.0, 5.0)).map(SE2.of)


def line(place, direction):
    return np.concatenate([place, direction[:, None]], axis=-1)


def same_lines(one, other):
    np.testing.assert_allclose(one[:, :2], other[:, :2], atol=1e-11)
    # Directions next to 0 and next to π are the same.
    apart = np.exp(2.0j * one[:, 2]) - np.exp(2.0j * other[:, 2])
    np.testing.assert_allclose(np.abs(apart), 0.0, atol=1e-11)


@given(place=places, direction=directions, shift=shifts, turns=st.integers(-3, 3))
def test_any_description_of_a_line_has_the_same_canonical_form(place, direction, shift, turns):
    along = np.stack([np.cos(direction), np.sin(direction)], axis=-1)
    again = line(place + shift[:, None] * along, direction + turns * np.pi)
    found = canonical(line(place, direction))
    same_lines(canonical(again), found)
    assert (found[:, 2] >= 0.0).all()
    assert (found[:, 2] < np.pi).all()


@given(place=places, direction=directions)
def test_the_canonical_point_is_the_nearest_to_the_origin(place, direction):
    lines = line(place, direction)
    found = canonical(lines)
    along = np.stack([np.cos(found[:, 2]), np.sin(found[:, 2])], axis=-1)
    np.testing.assert_allclose((found[:, :2] * along).sum(axis=-1), 0.0, atol=1e-12)
    np.testing.assert_allclose(signed_distance(lines, found[:, :2]), 0.0, atol=1e-11)
    same_lines(canonical(found), found)


@pytest.mark.parametrize("alpha", [-1e-17, 0.0, np.pi, -np.pi, 2.0 * np.pi])
def test_a_line_along_x_has_direction_zero(alpha):
    assert canonical(np.array([3.0, 1.0, alpha]))[2] == 0.0


@given(place=places, direction=directions, frame=frames, point=places)
def test_distances_do_not_depend_on_the_frame(place, direction, frame, point):
    lines = line(place, direction)
    inside = np.abs(signed_distance(in_frame(lines, frame), frame.invert().apply(point)))
    np.testing.assert_allclose(inside, np.abs(signed_distance(lines, point)), atol=1e-11)


@given(place=places, direction=directions, distance=shifts, shift=shifts)
def test_distance_is_positive_to_the_left(place, direction, distance, shift):
    along = np.stack([np.cos(direction), np.sin(direction)], axis=-1)
    left = np.stack([-np.sin(direction), np.cos(direction)], axis=-1)
    point = place + shift[:, None] * along + distance[:, None] * left
    np.testing.assert_allclose(signed_distance(line(place, direction), point), distance, atol=1e-11)


def test_the_closest_point_decides_and_no_point_is_infinitely_far():
    lines = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, np.pi / 2.0]])
    points = np.array([[3.0, 0.5], [1.25, -2.0]])
    np.testing.assert_allclose(closest_distance(lines, points), [0.5, 0.25])
    assert np.isinf(closest_distance(lines, np.zeros((0, 2)))).all()
