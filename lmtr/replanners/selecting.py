"""Selection: of the plans that the nearest neighbours suggest, the one with the least cost."""

from typing import Annotated, Any, Protocol

import numpy as np
from pydantic import Field

from lmtr.arrays import Array
from lmtr.replanners.plan_cost import PlanCost
from lmtr.replanners.replanner import Replanner
from lmtr.robot.model import RobotModel
from lmtr.settings import Settings


class Selection(Settings):
    """How a plan is selected.

    Attributes:
        candidates: Plans to choose among, those of so many nearest tasks.
        cost: What they are judged by.
    """

    candidates: Annotated[int, Field(ge=2)] = 32
    cost: PlanCost = PlanCost()


class Suggesting(Replanner, Protocol):
    """A replanner that has more than one plan for a task."""

    def suggest(self, x: Array, count: int) -> Array:
        """Plans τ (B, count, 264) for tasks x (B, 35), SI units, _S, that of ``plan`` first."""
        ...


class SelectingReplanner:
    """Plans with the cheapest suggestion; of equal ones with the nearest.

    LMTR decodes the modes of the nearest tasks in one batch, the trajectory library has their
    segments: both are selected from in the same way.

    Args:
        suggesting: Makes the plans.
        selection: How many they are, and what they cost.
        robot: Whose range of motion the cost is about.
    """

    def __init__(self, suggesting: Suggesting, selection: Selection, robot: RobotModel) -> None:
        self._suggesting, self._selection, self._robot = suggesting, selection, robot

    @property
    def name(self) -> str:
        """Of what it selects from, with the number of plans."""
        return f"{self._suggesting.name} (best of {self._selection.candidates})"

    @property
    def nbytes(self) -> int:
        """Memory of what it selects from (bytes)."""
        return self._suggesting.nbytes

    def plan(self, x: Array) -> Array:
        """Segments τ (B, 264) for tasks x (B, 35), SI units, _S."""
        plans = self._suggesting.suggest(x, self._selection.candidates)
        cheapest = self._selection.cost.of(x, plans, self._robot).argmin(axis=1)
        return np.asarray(plans[np.arange(len(plans)), cheapest])

    def describe(self) -> dict[str, Any]:
        """Selection beside the description of what it selects from."""
        selection = self._selection.model_dump(mode="json")
        return {**self._suggesting.describe(), "replanner": self.name, "selection": selection}
