"""The expert: from a task and noise to a solution, whatever the solver makes of it.

    τ̄ = f(x̄, τ̄₀) with τ̄₀ = h(x̄, ξ̄)   (Eq. 2)

A solve that does not converge is a value like any other, with its status and its last iterate.
"""

import time
from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from lmtr.expert.compilation import BuildReport, compiled
from lmtr.expert.formulation import Formulation, formulate, parameter_values
from lmtr.expert.initial_guess import InitialGuess, initial_guess
from lmtr.expert.settings import ExpertSettings, SolverSettings
from lmtr.expert.variables import pack, unpack
from lmtr.robot.model import N_FEET, RobotModel
from lmtr.task.sampling import Noise
from lmtr.task.task import Task
from lmtr.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

WINDOW_MARGIN = 1e-3
"""Distance to the edge of a timing window at which it counts as touched (s)."""


class Status(StrEnum):
    """Outcome of a solve."""

    CONVERGED = "converged"
    ITERATION_LIMIT = "iteration_limit"
    INFEASIBLE = "infeasible"
    DIVERGED = "diverged"
    ERROR = "error"


_STATUS = {
    "Solve_Succeeded": Status.CONVERGED,
    "Solved_To_Acceptable_Level": Status.CONVERGED,
    "Maximum_Iterations_Exceeded": Status.ITERATION_LIMIT,
    "Infeasible_Problem_Detected": Status.INFEASIBLE,
    "Diverging_Iterates": Status.DIVERGED,
    "Restoration_Failed": Status.DIVERGED,
    "Search_Direction_Becomes_Too_Small": Status.DIVERGED,
    "Error_In_Step_Computation": Status.DIVERGED,
}


@dataclass(frozen=True)
class Solution:
    """What came of one solve.

    Attributes:
        status: Outcome.
        message: The solver's own name for it, or the text of its exception.
        iterations: Iterations of the interior-point method.
        cost: The problem's cost at the trajectory.
        cost_terms: Weighted costs by name; they add up to ``cost``.
        constraint_violation: Largest violation of each group of the problem's own rows, in their
            scaled units, and of the bounds on variables.
        solve_cpu_s: Processor time of the solve (s).
        trajectory: Last iterate in the world frame; the guess if that is not finite.
        guess: The initial guess in the world frame.
        order: Feet in the order of their first swings in the guess.
        liftoff_swaps: Pairs of lift-offs of different feet whose order differs from the guess's.
        window_active: Whether a contact change touches its timing window: the problem's sparsity
            then limits the solution, and it may deserve a wider window.
    """

    status: Status
    message: str
    iterations: int
    cost: float
    cost_terms: dict[str, float]
    constraint_violation: dict[str, float]
    solve_cpu_s: float
    trajectory: Trajectory
    guess: Trajectory
    order: tuple[int, int, int, int]
    liftoff_swaps: int
    window_active: bool


class Expert:
    """Solves tasks of one robot and one set of settings.

    Building it takes a second, and some more when the problem's code is not in the cache yet.
    """

    def __init__(self, robot: RobotModel, settings: ExpertSettings, cache_dir: Path | None) -> None:
        """Build the problem.

        Args:
            robot: The robot.
            settings: Scope, costs, limits and solver.
            cache_dir: Folder of compiled problems, shared between processes; None interprets.
        """
        self.robot = robot
        self.settings = settings
        self._problem: Formulation = formulate(robot, settings)
        functions, self.build_report = compiled(self._problem.functions.all(), cache_dir)
        self._functions = {function.name(): function for function in functions}
        self._solver = _solver(self._functions, settings.solver)
        self._threads = ThreadpoolController()

    build_report: BuildReport
    """Whether the problem was compiled, and why not."""

    @property
    def compiled(self) -> bool:
        """Whether the problem runs as machine code."""
        return self.build_report.compiled

    def solve(self, task: Task, noise: Noise) -> Solution:
        """Optimize from the noisy initial guess.

        Args:
            task: Start, goal and obstacles in the world frame.
            noise: Smooth noise ξ̄ on the initial guess.

        Returns:
            The outcome; trouble of the solver is a status, not an exception.

        Raises:
            TaskError: No plan can solve the task.
        """
        scope = self.settings.scope
        task.require_possible(self.robot, scope.duration, scope.n_swings)
        guess = initial_guess(task, noise, self.robot, scope)
        start = pack(guess, self.robot, scope)
        parameters = parameter_values(
            task, guess, self.robot, self.settings, self._problem.parameters
        )
        begin = time.process_time()
        status, message, iterations, last = self._optimize(start, parameters)
        seconds = time.process_time() - begin
        return self._solution(guess, start, last, parameters, status, message, iterations, seconds)

    def _optimize(self, start: Array, parameters: Array) -> tuple[Status, str, int, Array]:
        """Status, message, iterations and last iterate."""
        problem = self._problem
        try:
            # One solve has too little linear algebra to share; threads would only spin.
            with self._threads.limit(limits=1):
                result = self._solver(
                    x0=start,
                    p=parameters,
                    lbx=problem.lower,
                    ubx=problem.upper,
                    lbg=problem.rows_lower,
                    ubg=problem.rows_upper,
                )
        except RuntimeError as error:
            return Status.ERROR, " ".join(str(error).split()), 0, start
        statistics = self._solver.stats()
        message = str(statistics["return_status"])
        status = _STATUS.get(message, Status.ERROR)
        last = np.array(result["x"]).reshape(-1)
        return status, message, int(statistics["iter_count"]), last

    def _solution(
        self,
        guess: InitialGuess,
        start: Array,
        last: Array,
        parameters: Array,
        status: Status,
        message: str,
        iterations: int,
        seconds: float,
    ) -> Solution:
        with np.errstate(all="ignore"):
            trajectory = unpack(last, guess, self.robot, self.settings.scope)
        if not (np.isfinite(last).all() and trajectory.is_finite()):
            trajectory, last = guess.trajectory, start
        terms = self._cost_terms(last, parameters)
        return Solution(
            status=status,
            message=message,
            iterations=iterations,
            cost=sum(terms.values()),
            cost_terms=terms,
            constraint_violation=self._violation(last, parameters),
            solve_cpu_s=seconds,
            trajectory=trajectory,
            guess=guess.trajectory,
            order=guess.order,
            liftoff_swaps=_swaps(guess.trajectory.liftoff_times, trajectory.liftoff_times),
            window_active=self._window_active(last),
        )

    def _cost_terms(self, x: Array, parameters: Array) -> dict[str, float]:
        values = np.array(self._functions["nlp_terms"](x, parameters)).reshape(-1)
        names = self._problem.functions.cost_names
        return {name: float(value) for name, value in zip(names, values, strict=True)}

    def _violation(self, x: Array, parameters: Array) -> dict[str, float]:
        problem = self._problem
        rows = np.array(self._functions["nlp_g"](x, parameters)).reshape(-1)
        excess = _excess(rows, problem.rows_lower, problem.rows_upper)
        violation = {
            name: float(block.max()) for name, block in problem.rows.unpack(excess).items()
        }
        violation["bounds"] = float(_excess(x, problem.lower, problem.upper).max())
        return violation

    def _window_active(self, x: Array) -> bool:
        times = self._problem.variables.unpack(x)["times"]
        departure = np.abs(times - self._problem.windows.nominal[:, 1:-1])
        return bool((departure > self.settings.limits.window - WINDOW_MARGIN).any())


def _solver(functions: dict[str, ca.Function], settings: SolverSettings) -> Any:  # noqa: ANN401
    cost, constraints = functions["nlp_f"], functions["nlp_g"]
    x = ca.MX.sym("x", cost.numel_in(0))
    p = ca.MX.sym("p", cost.numel_in(1))
    problem = {"x": x, "p": p, "f": cost(x, p), "g": constraints(x, p)}
    options = {
        "grad_f": functions["nlp_grad_f"],
        "jac_g": functions["nlp_jac_g"],
        "hess_lag": functions["nlp_hess_lag"],
        "no_nlp_grad": True,
        "calc_lam_p": False,
        "calc_f": False,
        "print_time": False,
        "error_on_fail": False,
        "show_eval_warnings": False,
        "ipopt": _ipopt_options(settings),
    }
    return ca.nlpsol("expert", "ipopt", problem, options)


def _ipopt_options(settings: SolverSettings) -> dict[str, float | int | str]:
    return {
        "print_level": 0,
        "sb": "yes",
        "max_iter": settings.max_iterations,
        "tol": settings.tolerance,
        "constr_viol_tol": settings.constraint_tolerance,
        # A small barrier from the start: costs are of order one and guesses near-feasible.
        "mu_strategy": "adaptive",
        "mu_init": 3e-3,
        "mu_max": 1e-2,
        "mu_min": 1e-5,
        # Stop early where the cost has settled, at small residuals of any other kind.
        "acceptable_tol": 1.0,
        "acceptable_iter": settings.early_iterations,
        "acceptable_constr_viol_tol": 1e-3,
        "acceptable_compl_inf_tol": 1e-3,
        "acceptable_obj_change_tol": settings.early_objective_change,
        # Scaling permutations cost MUMPS half its time here and bring nothing; QAMD ordering.
        "mumps_permuting_scaling": 0,
        "mumps_pivot_order": 6,
    }


def _excess(value: Array, lower: Array, upper: Array) -> Array:
    return np.maximum(np.maximum(lower - value, value - upper), 0.0)


def _swaps(before: Array, after: Array) -> int:
    """Pairs of lift-offs of different feet, (4, N̄_p) s each, whose order differs."""
    return sum(
        int(((before[a, :, None] < before[b]) != (after[a, :, None] < after[b])).sum())
        for a, b in combinations(range(N_FEET), 2)
    )
