"""The solver's derivatives against finite differences, and what its Hessian leaves out.

They are those of a short walk, interpreted; that machine code of the whole default problem gives
the same is shown once, beside the tests of compilation.
"""

import numpy as np
import pytest

STEP = 1e-6


def central(function, x, direction):
    """Directional derivative of a function of x, by central differences."""
    ahead, behind = function(x + STEP * direction), function(x - STEP * direction)
    return (np.asarray(ahead) - np.asarray(behind)).reshape(-1) / (2.0 * STEP)


def direction(drawn, *blocks, seed=0):
    """A random direction in some blocks of the variables only."""
    rng, layout = np.random.default_rng(seed), drawn.problem.variables
    step = np.zeros(layout.size)
    for name in blocks:
        step[layout[name]] = rng.standard_normal(layout[name].shape)
    return step


@pytest.mark.parametrize(
    "block", ["control", "times", "footholds", "swing_offset", "swing_drift", "forces"]
)
def test_gradient_and_jacobian_are_those_of_finite_differences(drawn, block):
    functions, p = drawn.problem.functions, drawn.parameters
    x, step = drawn.near_start(1), direction(drawn, block)
    gradient = np.array(functions.cost_gradient(x, p)[1]).reshape(-1)
    slope = central(lambda y: functions.cost(y, p), x, step)
    assert gradient @ step == pytest.approx(slope[0], rel=1e-6, abs=1e-6)
    jacobian = functions.constraint_jacobian(x, p)[1].sparse()
    rows = central(lambda y: functions.constraints(y, p), x, step)
    np.testing.assert_allclose(jacobian @ step, rows, rtol=1e-5, atol=2e-6)


def hessian(drawn, x, lam_f, lam_g, parameters=None):
    """The solver's Hessian, both triangles."""
    p = drawn.parameters if parameters is None else parameters
    upper = np.array(drawn.problem.functions.hessian(x, p, lam_f, lam_g))
    return upper + np.triu(upper, 1).T


def gradient_of_rows(drawn, lam_g):
    """λᵀ ∂g/∂x as a function of x."""
    jacobian = drawn.problem.functions.constraint_jacobian
    return lambda y: jacobian(y, drawn.parameters)[1].sparse().T @ lam_g


def test_curvature_of_contacts_is_exact_but_for_their_times(drawn):
    problem, layout = drawn.problem, drawn.problem.variables
    lam_g = np.random.default_rng(2).standard_normal(problem.rows.size)
    lam_g[problem.rows["range_of_motion"]] = 0.0
    x, blocks = drawn.near_start(2), ("footholds", "swing_offset", "swing_drift", "forces")
    step = direction(drawn, *blocks)
    others = np.concatenate([layout[name].reshape(-1) for name in blocks])
    expected = central(gradient_of_rows(drawn, lam_g), x, step)[others]
    found = (hessian(drawn, x, 0.0, lam_g) @ step)[others]
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-4)
    assert np.abs(found).max() > 1.0


def test_rows_have_no_curvature_in_the_motion_of_the_base_and_in_range_of_motion(drawn):
    lam_g = np.ones(drawn.problem.rows.size)
    along = direction(drawn, "control")
    assert not (hessian(drawn, drawn.near_start(3), 0.0, lam_g) @ along).any()
    lam_g = np.zeros(drawn.problem.rows.size)
    lam_g[drawn.problem.rows["range_of_motion"]] = 1.0
    anywhere = direction(drawn, *drawn.problem.variables.names)
    assert not (hessian(drawn, drawn.near_start(3), 0.0, lam_g) @ anywhere).any()


def test_rows_have_no_curvature_in_contact_times(drawn):
    lam_g = np.random.default_rng(3).standard_normal(drawn.problem.rows.size)
    along_times = direction(drawn, "times")
    assert not (hessian(drawn, drawn.near_start(3), 0.0, lam_g) @ along_times).any()


def test_hessian_of_quadratic_costs_is_exact(drawn):
    problem, x = drawn.problem, drawn.near_start(4)
    p = drawn.parameters.copy()
    p[problem.parameters["line_weights"]] = 0.0
    p[problem.parameters["foot_offset"]] = 0.0
    p[problem.parameters["proximal"]] = 0.0
    step = direction(drawn, *problem.variables.names)
    gradient = problem.functions.cost_gradient
    expected = central(lambda y: gradient(y, p)[1], x, step)
    found = hessian(drawn, x, 1.0, np.zeros(problem.rows.size), p) @ step
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)


def test_hessian_of_costs_is_positive_semidefinite_even_on_top_of_a_line(drawn):
    problem = drawn.problem
    x, p = drawn.near_start(5), drawn.parameters.copy()
    foothold = x[problem.variables["footholds"]][0, 0]
    p[problem.parameters["line_normals"][0]] = [1.0, 0.0]
    p[problem.parameters["line_offsets"][0]] = foothold[0]
    p[problem.parameters["line_weights"][0]] = 5.0
    gradient = problem.functions.cost_gradient
    across = np.zeros(problem.variables.size)
    across[problem.variables["footholds"][0, 0, 0]] = 1.0
    true = across @ central(lambda y: gradient(y, p)[1], x, across)
    values = np.linalg.eigvalsh(hessian(drawn, x, 1.0, np.zeros(problem.rows.size), p))
    assert true < -100.0
    assert values.min() > -1e-8


def test_damping_is_a_multiple_of_identity_on_times_and_footholds(drawn):
    problem, x = drawn.problem, drawn.near_start(6)
    p = drawn.parameters.copy()
    p[problem.parameters["proximal"]] = 0.0
    zero = np.zeros(problem.rows.size)
    added = hessian(drawn, x, 1.0, zero) - hessian(drawn, x, 1.0, zero, p)
    expected = np.zeros(problem.variables.size)
    for name in ("times", "footholds"):
        expected[problem.variables[name]] = drawn.settings.solver.proximal
    np.testing.assert_allclose(added, np.diag(expected), atol=1e-9)
