"""What each threshold removes, alone and in addition to the others, and where it might lie."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.filtering.solves import Solve, costs
from lmtr.arrays import Array, Flags
from lmtr.quality.filter import QualityThresholds, Verdict, judge
from lmtr.quality.rules import COST, RULES, SATURATED, Rule, with_detail

COST_RULE = Rule(COST, "cost_excess", "cost_excess", "of the expected cost")
"""The filter's judgement of costs, in the form of its other rules."""

NEGLIGIBLE = 1e-5
"""A figure whose worst value is less than this has no distribution to take a threshold from."""

FIXED = ("phase_shortest",)
"""Thresholds that no quantile suggests: solutions lie on the problem's own limit as they should."""


@dataclass(frozen=True)
class Removal:
    """One rule on many solves.

    Attributes:
        rule: The rule.
        values: Its figure, (n,).
        threshold: What it is held to.
        alone: Share of solves that it refuses.
        additional: Share that no other rule refuses.
    """

    rule: Rule
    values: Array
    threshold: float
    alone: float
    additional: float

    @property
    def has_distribution(self) -> bool:
        """Whether there is a distribution to see, not one value for all."""
        return bool(np.abs(self.values).max() >= NEGLIGIBLE and self.rule.threshold not in FIXED)


def verdicts(
    solves: Sequence[Solve], thresholds: QualityThresholds, expected: Array
) -> list[Verdict]:
    """The filter's verdicts, given the expected costs (n,)."""
    return [
        judge(s.status, s.cost, float(e), s.violations, thresholds, s.saturated)
        for s, e in zip(solves, expected, strict=True)
    ]


def removals(
    solves: Sequence[Solve], thresholds: QualityThresholds, expected: Array
) -> list[Removal]:
    """What every rule of the filter removes, the cost's last.

    Args:
        solves: Converged solves.
        thresholds: What they are held to.
        expected: Costs to be expected of them, (n,).
    """
    figures = {rule: _column(solves, rule) for rule in RULES}
    figures[COST_RULE] = thresholds.cost_model.excess(costs(solves), expected)
    broken = {
        rule: np.array([rule.broken(v, getattr(thresholds, rule.threshold)) for v in values])
        for rule, values in figures.items()
    }
    lying = np.array([bool(s.saturated) for s in solves])
    return [
        Removal(
            rule=rule,
            values=values,
            threshold=getattr(thresholds, rule.threshold),
            alone=float(broken[rule].mean()),
            additional=float((broken[rule] & ~_others(rule, broken, lying)).mean()),
        )
        for rule, values in figures.items()
    ]


def suggestions(groups: Sequence[Sequence[Solve]], keep: float) -> dict[str, float]:
    """Thresholds that keep a share of every group's solves, to two digits towards leniency.

    A vigorous motion may be what a hard task needs, so of the groups' quantiles the most lenient
    one counts: hard tasks are not to be dropped for being hard.
    """
    suggested: dict[str, float] = {}
    for rule in RULES:
        columns = [_column(group, rule) for group in groups]
        columns = [values[np.isfinite(values)] for values in columns]
        spread = max(np.abs(values).max(initial=0.0) for values in columns)
        if rule.threshold in FIXED or spread < NEGLIGIBLE:
            continue
        level, lenient = (1.0 - keep, min) if rule.at_least else (keep, max)
        at = lenient(float(np.quantile(values, level)) for values in columns if len(values))
        earlier = suggested.get(rule.threshold, at)
        suggested[rule.threshold] = lenient(earlier, two_digits(at, up=not rule.at_least))
    return suggested


def two_digits(value: float, *, up: bool) -> float:
    """A positive number to two significant digits, rounded up or down; others as they are."""
    if value <= 0.0:
        return value
    step = 10.0 ** (np.floor(np.log10(value)) - 1.0)
    return float(f"{(np.ceil if up else np.floor)(value / step) * step:.2g}")


def saturation(solves: Sequence[Solve]) -> dict[str, float]:
    """Share of solves that lie on each limit that any lies on."""
    names = sorted({name for s in solves for name in s.saturated})
    return {
        with_detail(SATURATED, name): float(np.mean([name in s.saturated for s in solves]))
        for name in names
    }


def _column(solves: Sequence[Solve], rule: Rule) -> Array:
    return np.array([getattr(s.violations, rule.figure) for s in solves])


def _others(rule: Rule, broken: dict[Rule, Flags], lying: Flags) -> Flags:
    """Whether each solve is refused for another reason than this rule's figure."""
    return np.any([lying, *(flags for other, flags in broken.items() if other != rule)], axis=0)
