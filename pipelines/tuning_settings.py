"""Settings of the search for the weights w of the task distance (Sec. 4.3)."""

from itertools import product
from math import isclose
from typing import Annotated

from pydantic import Field, model_validator

from lmtr.policies.distance import TaskWeights
from lmtr.settings import Count, NonNegative, Seed, Settings

Values = Annotated[tuple[NonNegative, ...], Field(min_length=1)]

ROUNDING = 1e-9
"""Weights whose ratios differ by less than this are the same."""


class TuningSection(Settings):
    """A coarse 4-D grid over w, walked on other courses than those that are reported.

    Attributes:
        chi_base: Weights of the base's state to try, each with all others of the other categories.
        chi_feet: Likewise of the feet's.
        eta: Likewise of the obstacles.
        gamma: Likewise of the goal.
        rollouts: Rollouts for each w.
        seed: Seed of the courses and starts; another one than ``evaluation.seed``.
        latent: Latent dimensions whose w is searched for, with the first training seed of each;
            none means all that look tasks up. The library is tuned wherever it is evaluated.
        points: So many w's at most are kept of each replanner, spread along the Pareto front of
            close steps and violation.
    """

    chi_base: Values = (0.3, 1.0, 3.0)
    chi_feet: Values = (0.3, 1.0, 3.0)
    eta: Values = (1.0, 3.0, 9.0)
    gamma: Values = (0.3, 1.0)
    rollouts: Count = 50
    seed: Seed = 1
    latent: Annotated[tuple[Annotated[int, Field(ge=1)], ...], Field(min_length=1)] | None = None
    points: Count = 5

    @model_validator(mode="after")
    def _some_weights(self) -> "TuningSection":
        if not self.grid():
            raise ValueError(
                "tuning must have a w that is not zero in all of chi_base, chi_feet, eta and "
                "gamma, got nothing else; give one of them a positive weight"
            )
        return self

    def grid(self) -> list[TaskWeights]:
        """All w's of the grid but multiples of others, which choose the same neighbours."""
        found: list[TaskWeights] = []
        for values in product(self.chi_base, self.chi_feet, self.eta, self.gamma):
            if any(values):
                found = with_new(found, [TaskWeights.of(values)])
        return found


def with_new(
    weights: list[TaskWeights], others: tuple[TaskWeights, ...] | list[TaskWeights]
) -> list[TaskWeights]:
    """The weights, and those of the others that are not multiples of one before them."""
    found = list(weights)
    for other in others:
        if not any(_parallel(other, each) for each in found):
            found.append(other)
    return found


def _parallel(one: TaskWeights, other: TaskWeights) -> bool:
    largest = max(one.values), max(other.values)
    return all(
        isclose(a / largest[0], b / largest[1], abs_tol=ROUNDING)
        for a, b in zip(one.values, other.values, strict=True)
    )
