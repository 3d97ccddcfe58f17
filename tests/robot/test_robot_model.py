"""Robot models: inertia of a body that can exist, and the neutral stance."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydantic import ValidationError

from lmtr.robot.model import ANYMAL, FEET, ROBOTS, RobotModel

OTHERS = ANYMAL.model_dump(exclude={"moments", "products"})
positive = st.floats(0.01, 10.0)


@given(
    masses=arrays(float, (6,), elements=st.floats(0.1, 5.0)),
    scatter=arrays(float, (6, 3), elements=st.floats(-0.5, 0.5)),
)
def test_the_inertia_of_point_masses_is_their_tensor(masses, scatter):
    corners = 0.3 * np.concatenate([np.eye(3), -np.eye(3)])  # so that the body has an extent
    r = corners + scatter * 0.2
    expected = np.einsum("k,kij->ij", masses, (r**2).sum(-1)[:, None, None] * np.eye(3))
    expected -= np.einsum("k,ki,kj->ij", masses, r, r)
    products = [float((masses * r[:, i] * r[:, j]).sum()) for i, j in ((0, 1), (0, 2), (1, 2))]
    robot = RobotModel(**OTHERS, moments=tuple(np.diag(expected)), products=tuple(products))
    np.testing.assert_allclose(robot.inertia_B, expected, rtol=1e-12, atol=1e-12)


@given(
    moments=st.tuples(positive, positive, positive),
    plane=st.integers(0, 2),
    excess=st.floats(1.001, 10.0),
    sign=st.sampled_from([-1.0, 1.0]),
)
def test_products_that_no_mass_distribution_has_are_refused(moments, plane, excess, sign):
    first, second = ((0, 1), (0, 2), (1, 2))[plane]
    products = [0.0, 0.0, 0.0]
    products[plane] = sign * excess * np.sqrt(moments[first] * moments[second])
    with pytest.raises(ValidationError, match="not positive definite"):
        RobotModel(**OTHERS, moments=moments, products=tuple(products))


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
def test_feet_stand_at_the_corners_that_their_names_say(robot):
    for foot, place in zip(FEET, robot.nominal_feet_B, strict=True):
        assert (place[1] > 0.0) == (foot[0] == "L")
        assert (place[0] > 0.0) == (foot[1] == "F")
        assert place[2] == -robot.nominal_height
    np.testing.assert_allclose(robot.nominal_feet_B[:, :2].sum(axis=0), 0.0, atol=1e-15)
    assert robot.weight == pytest.approx(9.81 * robot.mass)


@pytest.mark.parametrize("name", ["mass", "friction", "nominal_height"])
def test_figures_that_no_robot_has_are_refused(name):
    for value in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(ValidationError, match=name):
            RobotModel(**{**ANYMAL.model_dump(), name: value})
