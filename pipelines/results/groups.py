"""Evaluations that belong together: one replanner, policy and w, over all of its training seeds."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.figures.replanner_styles import expert_style, replanner_style
from lmtr.figures.style import SeriesStyle
from lmtr.policies.distance import TaskWeights
from lmtr.rollout.comparison import Tallies
from lmtr.rollout.summary import CONFIDENCE, RESAMPLES, Estimate
from lmtr.rollout.tally import RATES
from lmtr.streams import Purpose, stream
from pipelines.records import Row
from pipelines.tallies import tallies_of
from pipelines.trials import EXPERT, in_words
from pipelines.workspace import Workspace

Key = tuple[int | None, str, tuple[float, ...]]
"""Latent dimension (None: the library's or the expert's), policy and w."""


@dataclass(frozen=True)
class Group:
    """One replanner at one w, evaluated with each of its training seeds.

    Attributes:
        latent: n; 0 is the unimodal regressor, None the trajectory library or the expert.
        policy: How it selects.
        weights: w of its look-ups.
        members: Rows of ``evaluations``, by training seed.
        tallies: Sums of its rollouts.
    """

    latent: int | None
    policy: str
    weights: tuple[float, ...]
    members: Sequence[Row]
    tallies: Tallies

    @property
    def name(self) -> str:
        """What tables and figures call it, without its w."""
        if self.policy == EXPERT:
            return EXPERT
        family = "library" if self.latent is None else f"LMTR-{self.latent}"
        if self.latent == 0:
            return "unimodal"
        return family if self.policy == "nearest" else f"{family}, {self.policy}"

    @property
    def style(self) -> SeriesStyle:
        """Its look in all figures."""
        if self.policy == EXPERT:
            return expert_style()
        return replanner_style(self.latent, self.policy)

    @property
    def ids(self) -> list[str]:
        """Its evaluations."""
        return [row["evaluation_id"] for row in self.members]

    @property
    def in_words(self) -> str:
        """W in words; a dash for what looks nothing up."""
        looks_up = self.policy in ("nearest", "selected") and self.latent != 0
        return in_words(TaskWeights.of(self.weights)) if looks_up else "–"

    @property
    def falls(self) -> int:
        """Rollouts that diverged."""
        return int(self.tallies.sums["falls"].sum())

    @property
    def rollouts(self) -> int:
        """Rollouts in all."""
        seeds, courses = self.tallies.shape
        return seeds * courses

    def rate(self, name: str) -> Estimate:
        """A rate with its interval over courses and training seeds."""
        return Estimate(self.tallies.rate(name), *self._intervals[name])

    def by_seed(self, name: str) -> list[float]:
        """A rate of each training seed alone."""
        part, whole = (self.tallies.sums[each].sum(axis=1) for each in RATES[name])
        return [float(a / b) if b > 0.0 else float("nan") for a, b in zip(part, whole, strict=True)]

    def summary(self, name: str) -> float:
        """Mean over its evaluations of a number of their summaries; NaN where none has it."""
        found = [dict(row["summary"]).get(name, float("nan")) for row in self.members]
        known = [value for value in found if np.isfinite(value)]
        return float(np.mean(known)) if known else float("nan")

    @cached_property
    def _intervals(self) -> dict[str, tuple[float, float]]:
        seeds, courses = (_draws(size) for size in self.tallies.shape)
        tail = (1.0 - CONFIDENCE) / 2.0
        found = {}
        for name in RATES:
            drawn = self.tallies.drawn(name, seeds, courses)
            judged = drawn[np.isfinite(drawn)]
            ends = np.quantile(judged, [tail, 1.0 - tail]) if len(judged) else [np.nan, np.nan]
            found[name] = (float(ends[0]), float(ends[1]))
        return found


@dataclass(frozen=True)
class Groups:
    """The evaluations of one part of a study.

    Attributes:
        every: All groups, by latent dimension, policy and w; the library is last.
        reported: The w that tables report.
        missing: What could not be read, in sentences.
    """

    every: Sequence[Group]
    reported: tuple[float, ...]
    missing: Sequence[str] = ()

    def get(self, latent: int | None, policy: str = "nearest") -> Group | None:
        """The group of a replanner at the reported w, or at its only one."""
        mine = self.front(latent, policy)
        return next((g for g in mine if _same(g.weights, self.reported)), mine[0] if mine else None)

    def front(self, latent: int | None, policy: str = "nearest") -> list[Group]:
        """All groups of a replanner and policy, one per w."""
        return [g for g in self.every if g.latent == latent and g.policy == policy]

    @property
    def latents(self) -> list[int]:
        """Latent dimensions that were evaluated, ascending."""
        return sorted({g.latent for g in self.every if g.latent is not None})

    @property
    def policies(self) -> list[str]:
        """Policies of models that were evaluated, in the order met; ``nearest`` first."""
        return list(dict.fromkeys(g.policy for g in self.every if g.latent))

    @property
    def shown(self) -> list[Group]:
        """Every replanner and policy at the reported w."""
        kinds = dict.fromkeys((g.latent, g.policy) for g in self.every)
        found = [self.get(latent, policy) for latent, policy in kinds]
        return [group for group in found if group is not None]


def read_groups(workspace: Workspace, ids: Sequence[str], reported: tuple[float, ...]) -> Groups:
    """Read evaluations and put those together that differ by their training seed alone.

    Args:
        workspace: The home.
        ids: The evaluations.
        reported: w that tables report.
    """
    if not ids:
        return Groups([], reported, ["Nothing has been evaluated yet; run `lmtr evaluate`."])
    where = f"evaluation_id IN ({', '.join(repr(each) for each in ids)})"
    rows = workspace.lake.read("evaluations", where=where).to_pylist()
    found: dict[Key, list[Row]] = defaultdict(list)
    old = [row["evaluation_id"] for row in rows if row["policy"] is None]
    for row in rows:
        if row["policy"] is not None:
            found[row["latent"], row["policy"], tuple(row["weights"])].append(row)
    missing = []
    if old:
        missing.append(
            f"{len(old)} evaluations are of an older LMTR and left out: {', '.join(sorted(old))}."
        )
    groups = []
    for (latent, policy, weights), members in found.items():
        members.sort(key=lambda row: (row["training_seed"] or 0, row["evaluation_id"]))
        try:
            tallies = tallies_of(workspace.lake, [row["evaluation_id"] for row in members])
        except DataError as error:
            missing.append(f"{error}.")
            continue
        groups.append(Group(latent, policy, weights, members, tallies))
    return Groups(sorted(groups, key=_order), reported, missing)


def pooled(workspace: Workspace, group: Group, column: str) -> list[Array]:
    """A list column of ``rollouts`` for all rollouts of a group, one array each."""
    where = f"evaluation_id IN ({', '.join(repr(each) for each in group.ids)})"
    table = workspace.lake.read("rollouts", [column], where=where, order_by="evaluation_id, index")
    return [np.asarray(values, dtype=float) for values in table[column].to_pylist()]


def example(workspace: Workspace, group: Group, index: int | None = None) -> Row | None:
    """A row of ``rollouts`` with its motion: on a course, or of the first that was completed."""
    where = f"evaluation_id = '{group.ids[0]}' AND len(t) > 1"
    if index is not None:
        where += f" AND index = {index}"
    rows = workspace.lake.read(
        "rollouts", where=where, order_by="outcome = 'diverged', index", limit=1
    ).to_pylist()
    return rows[0] if rows else None


def _order(group: Group) -> tuple[bool, bool, int, int, tuple[float, ...]]:
    policies = ("nearest", "selected", "gaussian", "prior", "zero")
    place = policies.index(group.policy) if group.policy in policies else len(policies)
    return (
        group.policy == EXPERT,
        group.latent is None,
        group.latent or 0,
        place,
        group.weights,
    )


def _same(one: Sequence[float], other: Sequence[float]) -> bool:
    return len(one) == len(other) and bool(np.allclose(one, other))


def _draws(size: int) -> Array:
    """How often each of ``size`` things is drawn, (R, size), the same draws for the same size."""
    rng = stream(0, Purpose.BOOTSTRAP)
    return np.asarray(rng.multinomial(size, np.full(size, 1.0 / size), size=RESAMPLES), dtype=float)
