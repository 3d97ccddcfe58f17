"""What variants of the configuration change: κ, the amount of data, scaling and others."""

from collections.abc import Callable, Mapping, Sequence

from lmtr.figures.dots import Dot, DotPanel, dot_figure
from lmtr.figures.sweep import Reference, SweepPanel, SweepSeries, sweep_figure
from pipelines.results.blocks import Block, Chapter, Illustration, Measure, Missing, Row, Table
from pipelines.results.differences import (
    AMOUNT,
    KAPPA,
    changes,
    in_words,
    otherwise_varied,
    varied,
)
from pipelines.results.groups import Group, Groups
from pipelines.results.measures import MEASURES
from pipelines.results.parts import Part

SHOWN = ("close_share", "mean_violation", "large_violation_share")
"""Measures over a swept parameter."""

POLICIES = ("nearest", "selected")
"""Policies that variants are compared with."""


def variants_chapter(parts: Sequence[Part], groups: Mapping[str, Groups]) -> Chapter:
    """The base, which is first, and its variants.

    Args:
        parts: All parts of the study.
        groups: Evaluations of each part, by its name.
    """
    if len(parts) < 2:
        return Chapter("Variants", [Missing("The study has no variants.")])
    blocks: list[Block] = [_table(parts, groups)]
    blocks += _sweep(
        "amount",
        varied(parts, AMOUNT),
        groups,
        lambda part: float(part.training_rows),
        "training segments (with mirror images)",
        "Learning curve over the amount of data.",
    )
    blocks += _sweep(
        "kappa",
        varied(parts, frozenset({KAPPA})),
        groups,
        lambda part: part.config.training.model.kappa,
        "weight κ of the KL divergence (–)",
        "Weight of the KL divergence in Eq. 5.",
    )
    blocks += _dots([parts[0], *otherwise_varied(parts)], groups)
    return Chapter("Variants", blocks)


def _table(parts: Sequence[Part], groups: Mapping[str, Groups]) -> Table:
    base = parts[0]
    rows = []
    for part in parts:
        changed = in_words(changes(base.config, part.config))
        rows += [
            Row(
                [
                    part.name,
                    changed,
                    part.training_rows,
                    group.name,
                    group.tallies.shape[0],
                    *(MEASURES[name].measure(group) for name in (*SHOWN, "distance")),
                    group.falls,
                ],
                [part.dataset_id, *group.ids],
            )
            for group in _compared(groups[part.name])
        ]
    headers = [f"{MEASURES[name].name} ({MEASURES[name].unit})" for name in (*SHOWN, "distance")]
    return Table(
        "variants",
        "Every variant at the w that is reported; what it changes is named by its settings.",
        ["variant", "changes", "segments", "replanner", "seeds", *headers, "falls"],
        rows,
    )


def _compared(groups: Groups) -> list[Group]:
    return [g for g in groups.shown if g.policy in POLICIES]


def _sweep(
    name: str,
    parts: Sequence[Part],
    groups: Mapping[str, Groups],
    value: Callable[[Part], float],
    parameter: str,
    caption: str,
) -> list[Block]:
    """A figure over one parameter, if at least two parts differ in it."""
    there = {value(part): groups[part.name] for part in parts if groups[part.name].every}
    if len(there) < 2:
        return []
    series: dict[str, dict[float, Group]] = {}
    for x, found in sorted(there.items()):
        for group in _compared(found):
            series.setdefault(group.name, {})[x] = group
    constant = {label for label, members in series.items() if _is_constant(members)}
    swept = {
        label: members
        for label, members in series.items()
        if len(members) > 1 and label not in constant
    }
    if not swept:
        return []
    # What does not depend on the parameter, as the library does not on κ, is a line of reference.
    references = {label: next(iter(series[label].values())) for label in sorted(constant)}
    panels = [
        SweepPanel(
            MEASURES[rate].title,
            MEASURES[rate].label,
            [
                SweepSeries(
                    label,
                    {x: MEASURES[rate].by_seed(g) for x, g in members.items()},
                    {x: _ends(MEASURES[rate].measure(g)) for x, g in members.items()},
                )
                for label, members in swept.items()
            ],
            [
                Reference(label, (m := MEASURES[rate].measure(g)).value, _ends(m))
                for label, g in references.items()
            ],
        )
        for rate in SHOWN
    ]
    panels = [panel for panel in panels if panel.drawn]
    if not panels:
        return []
    styles = {label: next(iter(m.values())).style for label, m in swept.items()}
    styles |= {label: g.style for label, g in references.items()}
    return [
        Illustration(
            name,
            sweep_figure(panels, parameter, styles),
            f"{caption} Small dots: training seeds; line: their mean; bars: 95 % intervals over "
            "courses and seeds.",
        )
    ]


def _is_constant(members: Mapping[float, Group]) -> bool:
    """Whether a replanner gave the same numbers at several values of the parameter."""
    shares = [tuple(g.by_seed(rate) for rate in SHOWN) for g in members.values()]
    return len(shares) > 1 and all(each == shares[0] for each in shares)


def _dots(parts: Sequence[Part], groups: Mapping[str, Groups]) -> list[Block]:
    """The base beside variants that change something else."""
    there = [part for part in parts if groups[part.name].every]
    if len(there) < 2:
        return []
    panels, styles = [], {}
    for rate in (*SHOWN, "distance"):
        dots = {}
        for part in there:
            for group in _compared(groups[part.name]):
                found = MEASURES[rate].measure(group)
                styles[group.name] = group.style
                dots[part.name, group.name] = Dot(
                    found.value, _ends(found), tuple(MEASURES[rate].by_seed(group))
                )
        panels.append(DotPanel(MEASURES[rate].label, dots))
    # What only the base has would fill the figure with lonely dots.
    common = {s for s in styles if sum((p.name, s) in panels[0].dots for p in there) > 1}
    panels = [
        DotPanel(p.label, {key: dot for key, dot in p.dots.items() if key[1] in common})
        for p in panels
    ]
    if not common:
        return []
    return [
        Illustration(
            "other-variants",
            dot_figure(panels, [part.name for part in there], {s: styles[s] for s in common}),
            "The base and variants that change other settings, by the names of the table above. "
            "Lines: 95 % intervals over courses and training seeds; ticks: seeds.",
        )
    ]


def _ends(found: Measure) -> tuple[float, float]:
    return (
        found.value if found.low is None else found.low,
        found.value if found.high is None else found.high,
    )
