"""What the solver says of a solve, in the words of the project."""

import casadi as ca
import numpy as np
import pytest

from lmtr.expert.settings import SolverSettings
from lmtr.expert.solve import Status
from lmtr.expert.solver import InteriorPoint


class Stub:
    """Stands in for IPOPT: gives back its start with a given return status."""

    def __init__(self, said):
        self._said = said

    def __call__(self, x0, **_):
        if isinstance(self._said, Exception):
            raise self._said
        return {"x": x0}

    def stats(self):
        return {"return_status": self._said, "iter_count": 7}


@pytest.fixture
def outcome(drawn, monkeypatch):
    """The outcome of a solve of which IPOPT says this."""

    def of(said):
        monkeypatch.setattr(ca, "nlpsol", lambda *_: Stub(said))
        functions = {function.name(): function for function in drawn.problem.functions.all()}
        solver = InteriorPoint(drawn.problem, functions, SolverSettings())
        return solver.solve(drawn.start, drawn.parameters)

    return of


@pytest.mark.parametrize(
    ("said", "status"),
    [
        ("Solve_Succeeded", Status.CONVERGED),
        ("Solved_To_Acceptable_Level", Status.CONVERGED),
        ("Maximum_Iterations_Exceeded", Status.ITERATION_LIMIT),
        ("Maximum_CpuTime_Exceeded", Status.TIME_LIMIT),
        ("Infeasible_Problem_Detected", Status.INFEASIBLE),
        ("Diverging_Iterates", Status.DIVERGED),
        ("Restoration_Failed", Status.DIVERGED),
        ("Search_Direction_Becomes_Too_Small", Status.DIVERGED),
        ("Error_In_Step_Computation", Status.DIVERGED),
        ("Invalid_Number_Detected", Status.ERROR),
        ("User_Requested_Stop", Status.ERROR),
        ("Insufficient_Memory", Status.ERROR),
        ("A_Status_Of_Later_Versions", Status.ERROR),
    ],
)
def test_each_return_status_has_its_word(outcome, drawn, said, status):
    found = outcome(said)
    assert found.status == status
    assert (found.message, found.iterations) == (said, 7)
    np.testing.assert_array_equal(found.iterate, drawn.start)


def test_an_exception_of_the_solver_is_an_error_with_its_text(outcome, drawn):
    found = outcome(RuntimeError("out of\n  luck"))
    assert (found.status, found.message, found.iterations) == (Status.ERROR, "out of luck", 0)
    np.testing.assert_array_equal(found.iterate, drawn.start)
