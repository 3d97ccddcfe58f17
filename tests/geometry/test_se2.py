"""Ground-plane frames form a group that acts on points."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lmtr.geometry.rotation import rotation_matrix
from lmtr.geometry.se2 import SE2

poses = arrays(float, (3, 3), elements=st.floats(-10.0, 10.0)).map(SE2.of)
points = arrays(float, (3, 3), elements=st.floats(-10.0, 10.0))


def same(one, other):
    np.testing.assert_allclose(one.array(), other.array(), atol=1e-12)


@given(pose=poses)
def test_a_frame_after_its_inverse_is_no_frame(pose):
    same(pose.invert() @ pose, SE2.of(np.zeros((3, 3))))
    same(pose @ pose.invert(), SE2.of(np.zeros((3, 3))))
    same(pose.invert().invert(), pose)


@given(a=poses, b=poses, c=poses)
def test_composition_is_associative(a, b, c):
    same((a @ b) @ c, a @ (b @ c))


@given(a=poses, b=poses, p=points)
def test_composition_applies_the_inner_frame_first(a, b, p):
    np.testing.assert_allclose((a @ b).apply(p), a.apply(b.apply(p)), atol=1e-12)
    np.testing.assert_allclose(a.invert().apply(a.apply(p)), p, atol=1e-12)


@given(pose=poses, p=points)
def test_a_frame_turns_as_its_yaw_does_and_keeps_heights(pose, p):
    yaw = np.stack([np.zeros(3), np.zeros(3), pose.yaw], axis=-1)
    turned = np.einsum("nij,nj->ni", rotation_matrix(yaw), p)
    np.testing.assert_allclose(pose.rotate(p), turned, atol=1e-13)
    moved = pose.apply(p)
    assert np.array_equal(moved[:, 2], p[:, 2])
    origin = np.stack([pose.x, pose.y, np.zeros(3)], axis=-1)
    np.testing.assert_allclose(moved - turned, origin, atol=1e-13)
    np.testing.assert_array_equal(pose.apply(p[:, :2]), moved[:, :2])


@given(pose=poses, p=arrays(float, (3, 5, 2), elements=st.floats(-10.0, 10.0)))
def test_a_frame_spreads_over_further_axes(pose, p):
    together = pose.over(1).apply(p)
    for k in range(5):
        np.testing.assert_array_equal(together[:, k], pose.apply(p[:, k]))
