"""The expert: from a task and noise to a solution, whatever the solver makes of it.

    τ̄ = f(x̄, τ̄₀) with τ̄₀ = h(x̄, ξ̄)   (Eq. 2)

A solve that does not converge is a value like any other, with its status and its last iterate.
"""

from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from lmtr.arrays import Array
from lmtr.expert.compilation import compiled, compiled_linear_solver
from lmtr.expert.formulation import formulate, parameter_values
from lmtr.expert.initial_guess import InitialGuess, initial_guess
from lmtr.expert.saturation import saturated
from lmtr.expert.settings import ExpertSettings
from lmtr.expert.solver import InteriorPoint, Outcome
from lmtr.expert.variables import pack, unpack
from lmtr.quality.limits import Limit
from lmtr.quality.status import Status
from lmtr.robot.model import N_FEET, RobotModel
from lmtr.task.sampling import Noise
from lmtr.task.task import Task
from lmtr.trajectory.trajectory import Trajectory

__all__ = ["Expert", "Solution", "Status"]


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
        saturated: Limits of the problem that the solution lies on, see
            :mod:`lmtr.expert.saturation`.
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
    saturated: tuple[str, ...]

    @property
    def window_active(self) -> bool:
        """Whether a contact change touches its timing window.

        The problem's sparsity then limits the solution, and it may deserve a wider window.
        """
        return Limit.WINDOW in self.saturated


class Expert:
    """Solves tasks of one robot and one set of settings.

    Building it takes a second, and some more when its code is not in the cache yet;
    ``build_report`` says whether it runs as machine code, and why not.
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
        self._problem = formulate(robot, settings)
        functions, of_functions = compiled(self._problem.functions.all(), cache_dir)
        linear_solver, of_solver = compiled_linear_solver(self._problem, cache_dir)
        self.build_report = of_functions + of_solver
        self._functions = {function.name(): function for function in functions}
        self._solver = InteriorPoint(self._problem, self._functions, settings.solver, linear_solver)

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
        margin = self.settings.range_of_motion_margin
        task.require_possible(self.robot, scope.duration, scope.n_swings, margin)
        guess = initial_guess(task, noise, self.robot, scope)
        start = pack(guess, self.robot, scope)
        parameters = parameter_values(
            task, guess, self.robot, self.settings, self._problem.parameters
        )
        return self._solution(guess, start, parameters, self._solver.solve(start, parameters))

    def _solution(
        self, guess: InitialGuess, start: Array, parameters: Array, outcome: Outcome
    ) -> Solution:
        last = outcome.iterate
        with np.errstate(all="ignore"):  # what comes of it is judged just below
            trajectory = unpack(last, guess, self.robot, self.settings.scope)
        if not (np.isfinite(last).all() and trajectory.is_finite()):
            trajectory, last = guess.trajectory, start
        terms = self._cost_terms(last, parameters)
        return Solution(
            status=outcome.status,
            message=outcome.message,
            iterations=outcome.iterations,
            cost=sum(terms.values()),
            cost_terms=terms,
            constraint_violation=self._violation(last, parameters),
            solve_cpu_s=outcome.cpu_s,
            trajectory=trajectory,
            guess=guess.trajectory,
            order=guess.order,
            liftoff_swaps=_swaps(guess.trajectory.liftoff_times, trajectory.liftoff_times),
            saturated=saturated(last, self._problem, self.settings.limits),
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


def _excess(value: Array, lower: Array, upper: Array) -> Array:
    return np.maximum(np.maximum(lower - value, value - upper), 0.0)


def _swaps(before: Array, after: Array) -> int:
    """Pairs of lift-offs of different feet, (4, N̄_p) s each, whose order differs."""
    return sum(
        int(((before[a, :, None] < before[b]) != (after[a, :, None] < after[b])).sum())
        for a, b in combinations(range(N_FEET), 2)
    )
