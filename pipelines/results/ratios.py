"""Library over LMTR: violation at equal obstacle avoidance along the fronts, and jumps."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lmtr.figures.front_ratio import front_ratio_figure
from lmtr.figures.replanner_styles import LIBRARY_COLOUR
from lmtr.figures.style import INK, SeriesStyle
from lmtr.rollout.comparison import (
    AtLevel,
    at_equal_avoidance,
    common_levels,
    least_share,
    ratio,
)
from lmtr.rollout.fronts import pareto_front
from pipelines.results.blocks import Block, Chapter, Illustration, Measure, Missing, Row, Table
from pipelines.results.groups import Group, Groups
from pipelines.results.measures import MEASURES

LEVELS = 9
"""Levels of avoidance at which two fronts are held against each other."""

VIOLATIONS = ("mean_violation", "large_violation_share")
"""What is compared at equal avoidance."""

PLAIN, BEST, SELECTED = "plain", "best", "selected"


@dataclass(frozen=True)
class Pair:
    """The library against a replanner with modes.

    Attributes:
        kind: ``plain`` against plain; ``best`` LMTR at no more close steps than each point of the
            plain library; or both with the same selection, ``selected``.
        name: In words.
        latent: n of the LMTR; None where it is the best of all.
        levels: By measure, the comparison at each level.
        ids: All evaluations that were compared.
        reach: Least and greatest share of close steps of the library's front.
        style: Look of its curve.
    """

    kind: str
    name: str
    latent: int | None
    levels: dict[str, list[AtLevel]]
    ids: Sequence[str]
    reach: tuple[float, float]
    style: SeriesStyle


def pairs(groups: Groups) -> list[Pair]:
    """All comparisons along the front that the evaluations allow."""
    groups = replace(groups, every=[g for g in groups.every if _judged(g)])
    library = _alike(groups.front(None))
    if not library:
        return []
    found = []
    unbeaten = _unbeaten(library)
    for latent in (n for n in groups.latents if n):
        mine = _unbeaten(_alike(groups.front(latent)))
        if len(mine) > 1 and len(unbeaten) > 1:
            found.append(_plain(unbeaten, mine, latent))
    found += _best(library, [g for g in groups.every if g.latent])
    selecting = groups.get(None, "selected")
    for latent in (n for n in groups.latents if n):
        own = groups.get(latent, "selected")
        if selecting is not None and own is not None:
            found.append(_selected(selecting, own))
    return [pair for pair in found if any(pair.levels.values())]


def ratio_chapter(groups: Groups) -> Chapter:
    """The comparison at equal avoidance, as a figure and a table."""
    found = pairs(groups)
    if not found:
        return Chapter(
            "Violation at equal obstacle avoidance",
            [
                Missing(
                    "The library and an LMTR have no level of avoidance in common that was "
                    "evaluated; evaluate both with several w."
                )
            ],
        )
    blocks: list[Block] = []
    curves = [pair for pair in found if pair.kind != SELECTED]
    if any(np.isfinite(at.ratio.value) for p in curves for at in p.levels[VIOLATIONS[0]]):
        blocks.append(
            Illustration(
                "front-ratio",
                front_ratio_figure(
                    {
                        MEASURES[rate].title: {pair.name: pair.levels[rate] for pair in curves}
                        for rate in VIOLATIONS
                    },
                    styles={pair.name: pair.style for pair in curves},
                ),
                "How many times milder LMTR violates than the library where both have the same "
                "share of close footholds (linear between those w's of each that no other of its "
                "own beats on these courses). The best LMTR is that of all n, policies and w's "
                "with the least violation at no more close "
                "footholds than each point of the library; it was chosen on these courses, so its "
                "ratio is a little optimistic. Bands: 95 % "
                "intervals by paired bootstrap over courses and training seeds. Dashed: 5 and 10 "
                "times. Triangles: lower bounds.",
            )
        )
    rows = [
        Row(
            [
                pair.name,
                MEASURES[rate].name,
                100.0 * at.close_share,
                Measure.of(at.a, MEASURES[rate].scale),
                Measure.of(at.b, MEASURES[rate].scale),
                Measure.of(at.ratio),
            ],
            pair.ids,
        )
        for pair in found
        for rate in VIOLATIONS
        for at in pair.levels[rate]
    ]
    blocks.append(
        Table(
            "front-ratios",
            "Violation of the library (in mm, or % of samples), of LMTR, and their ratio at equal "
            "avoidance, with 95 % intervals.",
            ["pair", "measure", "close footholds (%)", "library", "LMTR", "library / LMTR (×)"],
            rows,
        )
    )
    return Chapter("Violation at equal obstacle avoidance", blocks)


def _plain(library: Sequence[Group], mine: Sequence[Group], latent: int) -> Pair:
    a, b = ([g.tallies for g in front] for front in (library, mine))
    levels = common_levels(a, b, LEVELS)
    return Pair(
        PLAIN,
        f"LMTR-{latent}, plain against plain",
        latent,
        {
            rate: at_equal_avoidance(a, b, levels, rate, resolution=resolution(mine, rate))
            if len(levels)
            else []
            for rate in VIOLATIONS
        },
        [each for g in (*library, *mine) for each in g.ids],
        _reach(library),
        mine[0].style,
    )


def _best(library: Sequence[Group], candidates: Sequence[Group]) -> list[Pair]:
    """For each point of the library the LMTR with the least violation at no more close steps."""
    levels: dict[str, list[AtLevel]] = {rate: [] for rate in VIOLATIONS}
    used: dict[str, None] = {}
    for point in _unbeaten(library):
        level = point.tallies.rate("close_share")
        able = [
            g
            for g in candidates
            if g.tallies.rate("close_share") <= level
            and not g.falls
            and g.tallies.shape[1] == point.tallies.shape[1]
        ]
        if not able:
            continue
        best = min(able, key=lambda g: g.tallies.rate("mean_violation"))
        used |= dict.fromkeys([*point.ids, *best.ids])
        for rate in VIOLATIONS:
            found = ratio(point.tallies, best.tallies, rate, resolution=resolution([best], rate))
            levels[rate].append(AtLevel(level, point.rate(rate), best.rate(rate), found, 1.0))
    style = SeriesStyle(INK, "D", (0, (5, 1.6)))
    name = "best LMTR against the plain library"
    return [Pair(BEST, name, None, levels, list(used), _reach(library), style)]


def _selected(library: Group, mine: Group) -> Pair:
    """Both with selection, at their own w's: the level is the library's share of close steps."""
    levels: dict[str, list[AtLevel]] = {rate: [] for rate in VIOLATIONS}
    if mine.tallies.shape[1] == library.tallies.shape[1]:
        for rate in VIOLATIONS:
            found = ratio(library.tallies, mine.tallies, rate, resolution=resolution([mine], rate))
            close = library.tallies.rate("close_share")
            levels[rate].append(AtLevel(close, library.rate(rate), mine.rate(rate), found, 1.0))
    style = SeriesStyle(LIBRARY_COLOUR, "D", (0, (5, 1.6)))
    name = f"LMTR-{mine.latent}, both selecting (not at equal avoidance)"
    ids = [*library.ids, *mine.ids]
    return Pair(SELECTED, name, mine.latent, levels, ids, _reach([library]), style)


def _reach(library: Sequence[Group]) -> tuple[float, float]:
    shares = [g.tallies.rate("close_share") for g in library]
    return min(shares), max(shares)


def _judged(group: Group) -> bool:
    """Whether its rollouts crossed any line."""
    return bool(np.isfinite(group.tallies.rate("close_share")))


def _unbeaten(groups: Sequence[Group]) -> list[Group]:
    """The w's of a replanner that no other one beats in both measures, fewest close steps first.

    A beaten one would bend the line between its neighbours: one of the library's would raise its
    violation there, and with it the ratio.
    """
    if not groups:
        return []
    points = [[g.tallies.rate("close_share"), g.tallies.rate("mean_violation")] for g in groups]
    return [groups[k] for k in pareto_front(np.array(points))]


def _alike(front: Sequence[Group]) -> list[Group]:
    """Those of a front that were walked with as many seeds and courses as most of them."""
    if not front:
        return []
    shape, _ = Counter(g.tallies.shape for g in front).most_common(1)[0]
    return [g for g in front if g.tallies.shape == shape]


def resolution(front: Sequence[Group], rate: str) -> float:
    """What cannot be told from nothing, of a share; a mean has no such limit.

    As if samples were independent, which those of one rollout are not: a nominal bound.
    """
    if not rate.endswith("_share"):
        return 0.0
    return max(least_share(g.tallies, rate) for g in front)
