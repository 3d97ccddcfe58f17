"""IPOPT as the expert's solver: an adapter that turns whatever happens into an outcome.

CasADi brings IPOPT, MUMPS and an OpenBLAS of its own.
"""

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
import threadpoolctl

from lmtr.arrays import Array
from lmtr.expert.formulation import Formulation
from lmtr.expert.settings import SolverSettings
from lmtr.quality.status import Status

_STATUS = {
    "Solve_Succeeded": Status.CONVERGED,
    "Solved_To_Acceptable_Level": Status.CONVERGED,
    "Maximum_Iterations_Exceeded": Status.ITERATION_LIMIT,
    "Maximum_CpuTime_Exceeded": Status.TIME_LIMIT,
    "Infeasible_Problem_Detected": Status.INFEASIBLE,
    "Diverging_Iterates": Status.DIVERGED,
    "Restoration_Failed": Status.DIVERGED,
    "Search_Direction_Becomes_Too_Small": Status.DIVERGED,
    "Error_In_Step_Computation": Status.DIVERGED,
}


EARLY_CONSTRAINT_TOLERANCE = 1e-3
"""Largest constraint violation of a solve that stops early (scaled rows)."""


class _CasadiOpenBLAS(threadpoolctl.OpenBLASController):  # type: ignore[misc]
    """The OpenBLAS that CasADi brings, which goes by a name that threadpoolctl does not know."""

    internal_api = "casadi_openblas"
    filename_prefixes = ("libcasadi-tp-openblas",)


threadpoolctl.register(_CasadiOpenBLAS)


@dataclass(frozen=True)
class Outcome:
    """What the solver says of one solve.

    Attributes:
        status: Outcome.
        message: The solver's own name for it, or the text of its exception.
        iterations: Iterations.
        iterate: Last iterate; the start if there was none.
        cpu_s: Processor time (s).
    """

    status: Status
    message: str
    iterations: int
    iterate: Array
    cpu_s: float


class InteriorPoint:
    """IPOPT for one formulation, with its functions as given (interpreted or compiled)."""

    def __init__(
        self,
        problem: Formulation,
        functions: dict[str, ca.Function],
        settings: SolverSettings,
        linear_solver: Path | None = None,
    ) -> None:
        """Prepare the solver.

        Args:
            problem: The problem.
            functions: Its functions, by name.
            settings: Tolerances and limits.
            linear_solver: Library of the linear solver made for the problem; MUMPS if there is
                none.
        """
        self._bounds = {
            "lbx": problem.lower,
            "ubx": problem.upper,
            "lbg": problem.rows_lower,
            "ubg": problem.rows_upper,
        }
        x = ca.MX.sym("x", problem.variables.size)
        p = ca.MX.sym("p", problem.parameters.size)
        cost, constraints = functions["nlp_f"](x, p), functions["nlp_g"](x, p)
        self._solver = ca.nlpsol(
            "expert",
            "ipopt",
            {"x": x, "p": p, "f": cost, "g": constraints},
            {
                "grad_f": functions["nlp_grad_f"],
                "jac_g": functions["nlp_jac_g"],
                "hess_lag": functions["nlp_hess_lag"],
                "no_nlp_grad": True,
                "calc_lam_p": False,
                "calc_f": False,
                "print_time": False,
                "error_on_fail": False,
                "show_eval_warnings": False,
                "ipopt": _ipopt_options(settings) | _linear_options(linear_solver),
            },
        )
        self._threads = threadpoolctl.ThreadpoolController()

    def solve(self, start: Array, parameters: Array) -> Outcome:
        """Solve from ``start``; failures of any kind are outcomes.

        Ctrl-C takes effect when the solve is over.
        """
        begin = time.process_time()
        try:
            # The fronts of one solve are too small to share: more threads would only spin.
            with _interrupt_held(), self._threads.limit(limits=1):
                result = self._solver(x0=start, p=parameters, **self._bounds)
        except RuntimeError as error:
            message = " ".join(str(error).split())
            return Outcome(Status.ERROR, message, 0, start, time.process_time() - begin)
        seconds = time.process_time() - begin
        statistics = self._solver.stats()
        message = str(statistics["return_status"])
        return Outcome(
            status=_STATUS.get(message, Status.ERROR),
            message=message,
            iterations=int(statistics["iter_count"]),
            iterate=np.array(result["x"]).reshape(-1),
            cpu_s=seconds,
        )


@contextmanager
def _interrupt_held() -> Iterator[None]:
    """Hold SIGINT back until the block is left, then hand it to the handler it was meant for.

    CasADi swallows what a handler raises, and IPOPT would call an interrupted solve a failed one.
    Only the main thread runs handlers; a handler that Python did not set cannot be put back.
    """
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or before is None:
        yield
        return
    came = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: came.set())
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if came.is_set():
            signal.raise_signal(signal.SIGINT)


def _ipopt_options(settings: SolverSettings) -> dict[str, float | int | str]:
    return {
        "print_level": 0,
        "sb": "yes",
        "max_iter": settings.max_iterations,
        "max_cpu_time": settings.time_limit,
        "tol": settings.tolerance,
        "constr_viol_tol": settings.constraint_tolerance,
        # The barrier follows the progress, by a rule that costs no solves of its own; IPOPT's
        # default, the quality function, ends at the limit of iterations now and then.
        "mu_strategy": "adaptive",
        "mu_oracle": "loqo",
        "mu_init": 1e-2,
        "mu_max": 1.0,
        "mu_min": 3e-5,
        # Away from the bounds at first: the feet of a guess stand on the edge of their range.
        "bound_push": 0.1,
        "bound_frac": 0.1,
        "slack_bound_push": 0.1,
        "slack_bound_frac": 0.1,
        # Stop early where the cost has settled, at small residuals of any other kind.
        "acceptable_tol": 1.0,
        "acceptable_iter": settings.early_iterations,
        "acceptable_constr_viol_tol": EARLY_CONSTRAINT_TOLERANCE,
        "acceptable_compl_inf_tol": 1e-3,
        "acceptable_obj_change_tol": settings.early_objective_change,
    }


def _linear_options(linear_solver: Path | None) -> dict[str, float | int | str]:
    if linear_solver is None:
        # No scaling permutation, and a minimum degree ordering for nearly dense rows.
        return {"mumps_permuting_scaling": 0, "mumps_pivot_order": 6}
    return {
        "linear_solver": "ma27",
        "hsllib": str(linear_solver),
        # It says exactly how much memory it needs, and has no other pivots to try.
        "ma27_la_init_factor": 1.0,
        "ma27_liw_init_factor": 1.0,
        "ma27_pivtol": 0.5,
        "ma27_pivtolmax": 0.5,
    }
