"""How two replanners compare: ratios of their rates, with intervals over courses and seeds.

A replanner's rate is a sum over the rollouts of all its training seeds and courses, divided by
another such sum (:mod:`lmtr.rollout.tally`). What it would be with other courses and other seeds is
resampled: courses are drawn with replacement, *the same ones for both replanners* since both walked
all of them, and so are the training seeds of each replanner that has several. A hard course is hard
for both, so the paired draws tell differences that separate intervals would hide.

A ratio by nothing says so: where the smaller rate is zero, or below what can be told from zero, the
ratio is a lower bound.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.rollout.fronts import interpolated
from lmtr.rollout.summary import CONFIDENCE, RESAMPLES, Estimate
from lmtr.rollout.tally import NAMES, RATES
from lmtr.streams import Purpose, stream

LEAST_COVERED = 0.5
"""Where fewer of the draws than this reach a level of avoidance, no interval is given for it."""


@dataclass(frozen=True)
class Tallies:
    """Sums of one replanner at one w, by name: (S, C), training seeds by courses.

    A replanner without a training seed, such as the library, has S = 1.

    Attributes:
        sums: By name, (S, C) each.
        courses: Seed and index of each course, by which two replanners are told to have walked the
            same ones; empty where they are not known.
    """

    sums: Mapping[str, Array]
    courses: tuple[tuple[int, int], ...] = ()

    @classmethod
    def stacked(
        cls,
        seeds: Sequence[Sequence[Mapping[str, float]]],
        courses: tuple[tuple[int, int], ...] = (),
    ) -> Self:
        """Of one list per training seed, each with the sums of every course in the same order.

        Sums that were not made yet when one of them was evaluated are NaN, and so is what is made
        of them.

        Raises:
            DataError: There are none, or seeds have different numbers of courses.
        """
        counts = sorted({len(walked) for walked in seeds})
        if len(counts) != 1 or counts[0] == 0:
            raise DataError(
                f"comparison: every training seed must have walked the same courses, got numbers "
                f"of courses {counts}; evaluate all with the same settings"
            )
        nan = float("nan")
        return cls(
            {n: np.array([[row.get(n, nan) for row in rows] for rows in seeds]) for n in NAMES},
            courses,
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Training seeds and courses."""
        seeds, courses = next(iter(self.sums.values())).shape
        return seeds, courses

    def rate(self, name: str) -> float:
        """A rate of :data:`~lmtr.rollout.tally.RATES` over all; NaN over nothing."""
        part, whole = (float(self.sums[each].sum()) for each in RATES[name])
        return part / whole if whole > 0.0 else float("nan")

    def drawn(self, name: str, seeds: Array, courses: Array) -> Array:
        """The same rate in each of R draws, (R,).

        Args:
            name: The rate.
            seeds: How often each training seed was drawn, (R, S).
            courses: How often each course was drawn, (R, C).
        """
        part, whole = (((seeds @ self.sums[each]) * courses).sum(axis=1) for each in RATES[name])
        return _over(part, whole)


@dataclass(frozen=True)
class Ratio:
    """A over B, and the percentile interval of its paired bootstrap.

    Attributes:
        value: The ratio; ∞ where only B is zero, NaN where both are, or one was not judged.
        low: Lower end of the interval.
        high: Upper end; ∞ where B may be zero.
        at_least: Whether B cannot be told from zero, so that the value is a lower bound.
    """

    value: float
    low: float
    high: float
    at_least: bool = False


@dataclass(frozen=True)
class AtLevel:
    """Two replanners at equal obstacle avoidance.

    Attributes:
        close_share: The level of avoidance.
        a: The other rate of A there.
        b: Likewise of B.
        ratio: A over B.
        covered: Share of the draws in which both fronts reach this level.
    """

    close_share: float
    a: Estimate
    b: Estimate
    ratio: Ratio
    covered: float


def ratio(a: Tallies, b: Tallies, rate: str, seed: int = 0, resolution: float = 0.0) -> Ratio:
    """A rate of A over the same rate of B.

    Args:
        a: Sums of A.
        b: Sums of B, on the same courses.
        rate: Name of the rate.
        seed: Seed of the bootstrap draws.
        resolution: Rates of B below this cannot be told from zero and are taken for this much, so
            that the ratio is a lower bound; :func:`least_share` for shares.

    Raises:
        DataError: The two did not walk the same courses.
    """
    seeds_a, seeds_b, courses = _draws([a], [b], seed)
    drawn = _bounded(a.drawn(rate, seeds_a, courses), b.drawn(rate, seeds_b, courses), resolution)
    return _ratio(a.rate(rate), b.rate(rate), drawn, resolution)


def least_share(tallies: Tallies, share: str) -> float:
    """The smallest share that can be told from zero: three events among all (rule of three).

    With none in n, the 95 % upper bound of the share is 3/n.
    """
    return float(3.0 / max(float(tallies.sums[RATES[share][1]].sum()), 1.0))


def common_levels(a: Sequence[Tallies], b: Sequence[Tallies], count: int = 5) -> Array:
    """Levels of close steps that the fronts of A and B both reach, (count,) evenly; or none, (0,).

    Args:
        a: A at each w of its front.
        b: Likewise B.
        count: How many levels; fronts that share a single level give that one.
    """
    ranges = [[each.rate("close_share") for each in front] for front in (a, b)]
    low = max(float(np.nanmin(each)) for each in ranges)
    high = min(float(np.nanmax(each)) for each in ranges)
    if not low <= high:
        return np.zeros(0)
    return np.linspace(low, high, count if high > low else 1)


def at_equal_avoidance(
    a: Sequence[Tallies],
    b: Sequence[Tallies],
    levels: Array,
    rate: str = "mean_violation",
    seed: int = 0,
    resolution: float = 0.0,
) -> list[AtLevel]:
    """A rate of A over that of B where both have the same share of close steps.

    Both rates lie on lines through the points of the fronts. The w's of the fronts are fixed, as
    they were chosen on other courses; their points move with each draw of courses and seeds.

    Args:
        a: A at each w of its front, all with the same training seeds and courses.
        b: Likewise B, on the same courses.
        levels: Shares of close steps, (k,), such as :func:`common_levels`.
        rate: What is compared there.
        seed: Seed of the bootstrap draws.
        resolution: See :func:`ratio`.

    Raises:
        DataError: A front is empty, or not all walked the same courses.
    """
    levels = np.asarray(levels, dtype=float)
    seeds_a, seeds_b, courses = _draws(a, b, seed)
    at = [interpolated(_points(front, rate), levels) for front in (a, b)]
    drawn = [
        interpolated(_drawn_points(front, rate, seeds, courses), levels)
        for front, seeds in ((a, seeds_a), (b, seeds_b))
    ]
    found = []
    for k, level in enumerate(levels):
        here_a, here_b = drawn[0][:, k], drawn[1][:, k]
        both = np.isfinite(here_a) & np.isfinite(here_b)
        here_a, here_b = here_a[both], here_b[both]
        if both.mean() < LEAST_COVERED:
            here_a, here_b = here_a[:0], here_b[:0]
        value_a, value_b = float(at[0][k]), float(at[1][k])
        ratios = _bounded(here_a, here_b, resolution)
        found.append(
            AtLevel(
                close_share=float(level),
                a=_estimate(value_a, here_a),
                b=_estimate(value_b, here_b),
                ratio=_ratio(value_a, value_b, ratios, resolution),
                covered=float(both.mean()),
            )
        )
    return found


def _points(front: Sequence[Tallies], rate: str) -> Array:
    return np.array([[each.rate("close_share"), each.rate(rate)] for each in front])


def _drawn_points(front: Sequence[Tallies], rate: str, seeds: Array, courses: Array) -> Array:
    """(R, m, 2)."""
    rates = [[each.drawn(n, seeds, courses) for n in ("close_share", rate)] for each in front]
    return np.moveaxis(np.array(rates), -1, 0)


def _draws(a: Sequence[Tallies], b: Sequence[Tallies], seed: int) -> tuple[Array, Array, Array]:
    """How often each seed of A and of B, and each course of both, was drawn: (R, …) each."""
    shapes_a, shapes_b = ({each.shape for each in front} for front in (a, b))
    courses = {shape[1] for shape in shapes_a | shapes_b}
    walked = {each.courses for each in (*a, *b) if each.courses}
    if len(walked) > 1 or len(shapes_a) != 1 or len(shapes_b) != 1 or len(courses) != 1:
        raise DataError(
            "comparison: both replanners must have walked the same courses with the same seeds at "
            f"every w, got (seeds, courses) {sorted(shapes_a)} and {sorted(shapes_b)}; evaluate "
            "both with the same settings"
        )
    rng = stream(seed, Purpose.BOOTSTRAP)
    # Courses come first, so that they are the same ones whatever the numbers of seeds.
    drawn = _counts(rng, courses.pop())
    return _counts(rng, shapes_a.pop()[0]), _counts(rng, shapes_b.pop()[0]), drawn


def _counts(rng: np.random.Generator, size: int) -> Array:
    return np.asarray(rng.multinomial(size, np.full(size, 1.0 / size), size=RESAMPLES), dtype=float)


def _over(part: Array, whole: Array) -> Array:
    """Quotients, NaN by nothing."""
    there = whole > 0.0
    return np.where(there, part / np.where(there, whole, 1.0), np.nan)


def _bounded(a: Array, b: Array, resolution: float) -> Array:
    """a/b with b at least the resolution; ∞ where only b is zero, NaN where both are."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(a / np.maximum(b, resolution))


def _ratio(a: float, b: float, drawn: Array, resolution: float) -> Ratio:
    """A ratio with the interval of its draws.

    A draw that says nothing (0/0) may stand for any ratio: it counts as 0 below and as ∞ above.
    """
    value = float(_bounded(np.array([a]), np.array([b]), resolution)[0])
    at_least = bool(np.isfinite(b) and b <= resolution and a > 0.0)
    if len(drawn) == 0 or np.isnan(drawn).all():
        return Ratio(value, float("nan"), float("nan"), at_least)
    tail = (1.0 - CONFIDENCE) / 2.0
    unknown = np.isnan(drawn)
    # Between a finite number and ∞ nothing can be interpolated: take a draw itself.
    low = np.quantile(np.where(unknown, 0.0, drawn), tail, method="lower")
    high = np.quantile(np.where(unknown, np.inf, drawn), 1.0 - tail, method="higher")
    return Ratio(value, float(low), float(high), at_least)


def _estimate(value: float, drawn: Array) -> Estimate:
    if len(drawn) == 0:
        return Estimate(value, float("nan"), float("nan"))
    tail = (1.0 - CONFIDENCE) / 2.0
    low, high = np.quantile(drawn, [tail, 1.0 - tail])
    return Estimate(value, float(low), float(high))
