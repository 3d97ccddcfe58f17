"""Three ways to judge a cost: by itself, by what the task predicts, by other draws of the task.

The third is what one would like to know, but it takes several solves for each task. It shows how
well the second does.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from benchmarks.filtering.solves import Kind, Solve, costs, features, of_kind
from lmtr.arrays import Array, Flags
from lmtr.quality.cost_model import CostModel

POOR = 0.1
"""Excess over the best draw of the same task from which on a solution counts as poor."""

DISTANCES = (0.5, 1.5, 2.3, 2.7, 3.1, 3.6)
"""Edges of the bins of goal distances (m)."""


@dataclass(frozen=True)
class Draws:
    """Solves of a few tasks from several guesses each.

    Attributes:
        over_best: Excess of each cost over the best of its task, (n,).
        over_expected: Excess over what the task predicts, (n,).
        raw: Cost, (n,).
        within: Standard deviation of costs of one task over their mean, averaged over tasks.
        between: Standard deviation over tasks of their mean excess over what they predict.
    """

    over_best: Array
    over_expected: Array
    raw: Array
    within: float
    between: float

    @property
    def correlation(self) -> float:
        """Between excess over the expected cost and excess over the best draw."""
        return float(np.corrcoef(self.over_expected, self.over_best)[0, 1])

    def ranking(self, score: Array) -> float:
        """Chance that ``score`` (n,) ranks a poor solution above another one."""
        poor = self.over_best > POOR
        return float(np.mean(score[poor][:, None] > score[~poor][None, :]))

    def precision(self, excess: float) -> float:
        """Share of poor solutions among those beyond an excess over the expected cost."""
        beyond = self.over_expected > excess
        return float(np.mean(self.over_best[beyond] > POOR)) if beyond.any() else np.nan


def compare_draws(solves: Sequence[Solve], model: CostModel) -> Draws:
    """Compare the draws of each task with each other and with what the task predicts."""
    solves = of_kind(solves, Kind.DRAWS)
    task, cost = np.array([s.index for s in solves]), costs(solves)
    excess = model.excess(cost, model.predict(features(solves)))
    best, within, between = np.zeros_like(cost), [], []
    for index in np.unique(task):
        mine = task == index
        best[mine] = cost[mine].min()
        within.append(np.std(cost[mine]) / np.mean(cost[mine]))
        between.append(np.mean(excess[mine]))
    return Draws(
        over_best=cost / best - 1.0,
        over_expected=excess,
        raw=cost,
        within=float(np.mean(within)),
        between=float(np.std(between)),
    )


@dataclass(frozen=True)
class Groups:
    """Share that ways of judging refuse from groups of tasks.

    Attributes:
        names: The groups.
        counts: Solves in each.
        raw: Share refused by a threshold on the cost itself.
        conditional: Share refused by one on its excess over what the task predicts.
        filtered: Share refused by the whole filter.
    """

    names: list[str]
    counts: list[int]
    raw: list[float]
    conditional: list[float]
    filtered: list[float]


def by_difficulty(
    solves: Sequence[Solve], model: CostModel, keep: float, refused: Flags
) -> tuple[Groups, Groups]:
    """What is refused by goal distance and by number of lines.

    Args:
        solves: Converged solves, (n,).
        model: What tasks predict of costs.
        keep: Share of all that either threshold on costs keeps.
        refused: What the whole filter refuses, (n,).
    """
    cost = costs(solves)
    excess = model.excess(cost, model.predict(features(solves)))
    beyond = [values > np.quantile(values, keep) for values in (cost, excess)]
    distance, lines = (np.array([getattr(s, n) for s in solves]) for n in ("distance", "lines"))
    bins = np.clip(np.digitize(distance, DISTANCES) - 1, 0, len(DISTANCES) - 2)
    spans = [f"{a:g}–{b:g}" for a, b in pairwise(DISTANCES)]
    counted = [str(count) for count in range(int(lines.max(initial=0)) + 1)]
    return _groups(spans, bins, [*beyond, refused]), _groups(counted, lines, [*beyond, refused])


def _groups(names: list[str], group: Array, refused: Sequence[Flags]) -> Groups:
    present = [k for k in range(len(names)) if (group == k).any()]
    shares = [[float(flags[group == k].mean()) for k in present] for flags in refused]
    return Groups([names[k] for k in present], [int((group == k).sum()) for k in present], *shares)
