"""Robot models: inertia of a body that can exist, and the neutral stance."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydantic import ValidationError

from lmtr.robot.model import ANYMAL, FEET, HYQ, ROBOTS, RobotModel

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


def test_the_robots_have_the_published_figures():
    """TOWR's models, but for the tighter range of motion of ANYmal and for friction."""
    assert ANYMAL.model_dump() == {
        "name": "anymal",
        "mass": 29.5,
        "moments": (0.946438, 1.94478, 2.01835),
        "products": (0.000938112, -0.00595386, -0.00146328),
        "nominal_forward": 0.34,
        "nominal_lateral": 0.19,
        "nominal_height": 0.42,
        "range_of_motion": (0.16, 0.12, 0.10),
        "friction": 0.7,
    }
    assert HYQ.model_dump() == {
        "name": "hyq",
        "mass": 83.0,
        "moments": (4.26, 8.97, 9.88),
        "products": (-0.0063, 0.193, 0.0126),
        "nominal_forward": 0.31,
        "nominal_lateral": 0.29,
        "nominal_height": 0.58,
        "range_of_motion": (0.20, 0.20, 0.10),
        "friction": 0.7,
    }
    assert ROBOTS == {"anymal": ANYMAL, "hyq": HYQ}


@pytest.mark.parametrize("name", ["mass", "friction", "nominal_height"])
def test_figures_that_no_robot_has_are_refused(name):
    for value in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(ValidationError, match=name):
            RobotModel(**{**ANYMAL.model_dump(), name: value})
