"""One small problem and one full one, built once for all tests of the expert."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from lmtr.expert.formulation import Formulation, formulate, parameter_values
from lmtr.expert.initial_guess import InitialGuess, initial_guess
from lmtr.expert.settings import ExpertSettings, Scope
from lmtr.expert.solve import Expert, Solution
from lmtr.expert.variables import pack
from lmtr.robot.model import ANYMAL
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import Noise, TaskDistribution, sample_noise, sample_task
from lmtr.task.task import Task

Array = NDArray[np.float64]

SHORT = ExpertSettings(scope=Scope(duration=2.5, n_swings=2))
"""A short walk: the same problem, a third of the size."""

NEAR = TaskDistribution(
    goal_distance=(0.7, 0.9), goal_lateral=0.1, first_obstacle=(0.4, 0.5), obstacle_count=(1, 1)
)
"""Tasks that a short walk can solve."""


def draw(settings: ExpertSettings, tasks: TaskDistribution, index: int) -> tuple[Task, Noise]:
    """Task and noise number ``index``."""
    rng = stream(0, Purpose.TASK, index)
    task = sample_task(tasks, ANYMAL, rng)
    return task, sample_noise(tasks, settings.scope.n_swings, rng)


class Drawn:
    """A formulation with the guess, start and parameters of one task."""

    def __init__(self, settings: ExpertSettings, tasks: TaskDistribution) -> None:
        self.settings = settings
        self.task, self.noise = draw(settings, tasks, 0)
        self.problem: Formulation = formulate(ANYMAL, settings)
        self.guess: InitialGuess = initial_guess(self.task, self.noise, ANYMAL, settings.scope)
        self.start: Array = pack(self.guess, ANYMAL, settings.scope)
        self.parameters: Array = parameter_values(
            self.task, self.guess, ANYMAL, settings, self.problem.parameters
        )

    def near_start(self, seed: int) -> Array:
        """A point at which nothing is special: the start, shaken, inside the bounds.

        Beyond the timing windows the sparsity would leave out phases that samples do meet.
        """
        rng = np.random.default_rng(seed)
        shaken = self.start + 0.01 * rng.standard_normal(self.start.shape)
        return np.clip(shaken, self.problem.lower + 3e-3, self.problem.upper - 3e-3)


@pytest.fixture(scope="session")
def drawn() -> Drawn:
    return Drawn(SHORT, NEAR)


@pytest.fixture(scope="session")
def drawn_in_full() -> Drawn:
    """The default problem with a task of the default distribution."""
    return Drawn(ExpertSettings(), TaskDistribution())


@pytest.fixture(scope="session")
def short() -> ExpertSettings:
    """Settings of a short walk."""
    return SHORT


@pytest.fixture(scope="session")
def nearby() -> Callable[[int], tuple[Task, Noise]]:
    """Tasks and noise for the short walk, by number."""
    return lambda index: draw(SHORT, NEAR, index)


@pytest.fixture(scope="session")
def expert_cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("expert")


@pytest.fixture(scope="session")
def short_expert(expert_cache: Path) -> Expert:
    return Expert(ANYMAL, SHORT, expert_cache)


@pytest.fixture(scope="session")
def long_expert() -> Expert:
    return Expert(ANYMAL, ExpertSettings(), None)


@dataclass(frozen=True)
class Solved:
    """A task of the default distribution and what the expert made of it."""

    task: Task
    noise: Noise
    solution: Solution


@pytest.fixture(scope="session")
def solved_tasks(long_expert: Expert) -> list[Solved]:
    """The first tasks of the default distribution, with two lines each."""
    pairs = [draw(long_expert.settings, TaskDistribution(), index) for index in range(3)]
    return [Solved(task, noise, long_expert.solve(task, noise)) for task, noise in pairs]


@pytest.fixture(scope="session")
def solved(solved_tasks: list[Solved]) -> tuple[Task, Solution]:
    return solved_tasks[1].task, solved_tasks[1].solution
