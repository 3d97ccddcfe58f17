"""The comparison of replanners: one table at the reported w, the fronts over w, Fig. 4."""

import numpy as np

from lmtr.figures.distributions import distribution_figure
from lmtr.figures.dots import Dot, DotPanel, dot_figure
from lmtr.figures.sweep import Reference, SweepPanel, SweepSeries, sweep_figure
from lmtr.figures.trade_off import TradeOff, trade_off_figure
from lmtr.rollout.settings import Criteria
from pipelines.results.blocks import Block, Chapter, Illustration, Measure, Missing, Row, Table
from pipelines.results.groups import Group, Groups, pooled
from pipelines.results.measures import MEASURES, PHYSICS, Measured
from pipelines.trials import EXPERT
from pipelines.workspace import Workspace

HIGHLIGHTED = (0, 3, 6, 12)
"""Latent dimensions that the distributions tell apart, where they were evaluated."""

DISTRIBUTIONS = (
    "Fig. 4 a, b. (a) Closest foothold of each foot to each line that was crossed; within the "
    "shaded {close:g} cm it counts as close. (b) How far contacting feet leave the ±{limit:g} m "
    "forward range of motion, on a logarithmic axis; the area under a curve is the share of "
    "samples with any violation. Bands: 95 % intervals by bootstrap over rollouts."
)

FRONT_MEASURES = ("close_share", "mean_violation", "large_violation_share", "distance")
"""Columns of the table of fronts."""

LOGARITHMIC = (MEASURES["mean_violation"], MEASURES["large_violation_share"])
"""Measures whose axis over n is logarithmic."""

POLICY_NAMES = {
    "nearest": r"nearest neighbour $\pi_{nbr}$",
    "selected": "best of the nearest",
    "gaussian": r"Gaussian $\pi_\mathcal{N}$",
    "prior": "prior z ~ N(0, I)",
    "zero": "z = 0",
}


def comparison_chapter(workspace: Workspace, groups: Groups, criteria: Criteria) -> Chapter:
    """How all replanners did on the same courses."""
    blocks: list[Block] = [Missing(text) for text in groups.missing]
    if groups.every:
        blocks += [
            replanner_table(groups),
            physics_table(groups),
            *distributions(workspace, groups, criteria),
            *fronts(groups),
            *over_latent(groups),
            *over_policies(groups),
        ]
    return Chapter("Replanners on the same courses", blocks)


def replanner_table(groups: Groups) -> Table:
    """Every replanner and policy at the reported w."""
    walking = [each for name, each in MEASURES.items() if name not in PHYSICS]
    return Table(
        "replanners",
        "Every replanner and policy at the w that is reported, with 95 % intervals by bootstrap "
        "over courses and training seeds. Plan: median time per plan "
        "when all courses are planned at once.",
        [
            "replanner",
            "w (χ_base, χ_feet, η, γ)",
            "seeds",
            "rollouts",
            *(f"{m.name} ({m.unit})" for m in walking),
            "falls",
            "plan (µs)",
            "memory (MB)",
        ],
        [
            Row(
                [
                    group.name,
                    group.in_words,
                    group.tallies.shape[0],
                    group.rollouts,
                    *(m.measure(group) for m in walking),
                    group.falls,
                    1e6 * group.summary("plan_seconds"),
                    1e-6 * group.summary("nbytes"),
                ],
                group.ids,
            )
            for group in groups.shown
        ],
    )


def physics_table(groups: Groups) -> Table:
    """Whether the planned forces explain the motion that is carried out, and can be had."""
    return Table(
        "physics",
        "Planned forces against the motion carried out, of the same rollouts: what they leave "
        "unexplained (mean, and 95th percentile of all samples), and standing feet whose force "
        "is outside the friction pyramid, or pulls.",
        [
            "replanner",
            *(f"{MEASURES[name].name} ({MEASURES[name].unit})" for name in PHYSICS),
            "linear residual, 95 % below (m/s²)",
            "angular residual, 95 % below (rad/s²)",
        ],
        [
            Row(
                [
                    group.name,
                    *(MEASURES[name].measure(group) for name in PHYSICS),
                    group.summary("linear_residual_p95"),
                    group.summary("angular_residual_p95"),
                ],
                group.ids,
            )
            for group in groups.shown
        ],
    )


def distributions(workspace: Workspace, groups: Groups, criteria: Criteria) -> list[Block]:
    """Fig. 4 a and b at the reported w."""
    plain = [g for g in groups.shown if g.policy in ("nearest", EXPERT)]
    chosen = [g for g in groups.shown if g.policy == "selected" and g.latent in (None, 6)]
    drawn = {g.name: g for g in [*plain, *chosen]}
    distances = {name: pooled(workspace, g, "clearances") for name, g in drawn.items()}
    violations = {name: pooled(workspace, g, "violations") for name, g in drawn.items()}
    judged = [
        name for name in drawn if sum(map(len, distances[name])) and sum(map(len, violations[name]))
    ]
    if not judged:
        return [Missing("No replanner has crossed a line yet, so there are no distances.")]
    some = [name for name in judged if drawn[name].latent in (None, *highlighted(groups))]
    return [
        Illustration(
            "distributions",
            distribution_figure(
                {name: distances[name] for name in judged},
                {name: violations[name] for name in judged},
                close=criteria.clearance,
                severe=criteria.large_violation,
                styles={name: drawn[name].style for name in judged},
                highlighted=some if len(judged) > len(some) > 1 else None,
            ),
            DISTRIBUTIONS.format(close=100 * criteria.clearance, limit=criteria.forward_limit),
        )
    ]


def fronts(groups: Groups) -> list[Block]:
    """Fig. 4 c: every w of every replanner that has several, and its table."""
    kinds = dict.fromkeys((g.latent, g.policy) for g in groups.every)
    series = {kind: groups.front(*kind) for kind in kinds}
    several = [kind for kind, members in series.items() if len(members) > 1]
    if not several:
        return [Missing("Every replanner was evaluated with one w, so there is no front to show.")]
    shown = {
        kind: members
        for kind, members in series.items()
        if kind in several or kind[1] == "selected" or kind[0] == 0
    }
    kept = {
        members[0].name: members
        for kind, members in shown.items()
        if _in_front_figure(kind, groups)
    }
    styles = {name: members[0].style for name, members in kept.items()}
    blocks: list[Block] = []
    for stem, violation, label in (
        ("front", MEASURES["mean_violation"], "mean violation of the range of motion (mm)"),
        ("front-severe", MEASURES["large_violation_share"], "contact samples over the limit (%)"),
    ):
        points = {
            name: [_trade_off(member, violation, groups) for member in members]
            for name, members in kept.items()
        }
        blocks.append(
            Illustration(
                stem,
                trade_off_figure(points, label, styles),
                "Fig. 4 c. One point per w; joined: those that no other w of the same replanner "
                "beats in both measures, with 95 % intervals over courses and training seeds. "
                "Star: the w of the table above. w's were chosen on other courses.",
            )
        )
    rows = [
        Row(
            [
                member.name,
                member.in_words,
                *(MEASURES[name].measure(member) for name in FRONT_MEASURES),
                member.falls,
            ],
            member.ids,
        )
        for kind in several
        for member in sorted(series[kind], key=lambda g: g.tallies.rate("close_share"))
    ]
    headers = [f"{MEASURES[name].name} ({MEASURES[name].unit})" for name in FRONT_MEASURES]
    blocks.append(
        Table(
            "fronts",
            "Every w that was evaluated on the reported courses.",
            ["replanner", "w (χ_base, χ_feet, η, γ)", *headers, "falls"],
            rows,
        )
    )
    return blocks


def highlighted(groups: Groups) -> list[int]:
    """Latent dimensions, few enough to be told apart in one figure."""
    known = groups.latents
    usual = [n for n in HIGHLIGHTED if n in known]
    return usual if any(usual) else [*usual, *[n for n in known if n][-3:]]


def _in_front_figure(kind: tuple[int | None, str], groups: Groups) -> bool:
    """Some dimensions and the library, by policies that look up."""
    latent, policy = kind
    return policy in ("nearest", "selected") and (latent is None or latent in highlighted(groups))


def _trade_off(group: Group, violation: Measured, groups: Groups) -> TradeOff:
    close, found = group.rate("close_share"), violation.measure(group)
    return TradeOff(
        close.value,
        found.value,
        close_interval=(close.low, close.high),
        violation_interval=_ends(found),
        reported=groups.get(group.latent, group.policy) is group
        and len(groups.front(group.latent, group.policy)) > 1,
    )


def over_latent(groups: Groups) -> list[Block]:
    """Performance over n: the claim of a plateau."""
    latents = [n for n in groups.latents if groups.get(n) is not None]
    if len(latents) < 2:
        return [Missing("Fewer than two latent dimensions were evaluated: nothing to see over n.")]
    panels: list[SweepPanel] = []
    styles = {}
    names = ("close_share", "mean_violation", "large_violation_share", "distance")
    for measured in (MEASURES[name] for name in (*names, "mean_velocity_jump", "mean_foot_jump")):
        series = []
        for policy in ("nearest", "selected"):
            members = {n: groups.get(n, policy) for n in latents if n > 0 or policy == "nearest"}
            there = {float(n): g for n, g in members.items() if g is not None}
            if not there:
                continue
            name = f"LMTR-n, {POLICY_NAMES[policy]}"
            styles[name] = there[max(there)].style
            series.append(
                SweepSeries(
                    name,
                    {n: measured.by_seed(g) for n, g in there.items()},
                    {n: _ends(measured.measure(g)) for n, g in there.items()},
                )
            )
        references = []
        for policy in ("nearest", "selected"):
            library = groups.get(None, policy)
            if library is not None:
                found = measured.measure(library)
                styles[library.name] = library.style
                references.append(Reference(library.name, found.value, _ends(found)))
        # The library violates so much more that a linear axis shows nothing else.
        log = measured in LOGARITHMIC
        panels.append(SweepPanel(measured.title, measured.label, series, references, log))
    panels = [panel for panel in panels if panel.drawn]
    if not panels:
        return [Missing("No measure of the rollouts has a value over n.")]
    return [
        Illustration(
            "latent",
            sweep_figure(panels, "latent dimension n", styles, _latent_ticks(latents)),
            "Performance over the latent dimension n; 0 is the unimodal regressor. Small dots: "
            "training seeds; line: their mean; bars: 95 % intervals over courses and seeds; bands: "
            "the library.",
        )
    ]


def over_policies(groups: Groups) -> list[Block]:
    """One dot per policy, dimension and measure."""
    policies = [p for p in groups.policies if p != EXPERT]
    if len(policies) < 2:
        return [Missing("Only one policy was evaluated: there is nothing to compare it with.")]
    latents = [n for n in highlighted(groups) if n]
    panels, styles = [], {}
    for name in ("close_share", "mean_violation", "distance", "mean_velocity_jump"):
        measured, dots = MEASURES[name], {}
        for policy in policies:
            for latent in (*latents, None):
                group = groups.get(latent, policy)
                if group is None:
                    continue
                series = "library" if latent is None else f"LMTR-{latent}"
                base = groups.get(latent)
                styles[series] = (base or group).style
                found = measured.measure(group)
                dots[POLICY_NAMES.get(policy, policy), series] = Dot(
                    found.value, _ends(found), tuple(measured.by_seed(group))
                )
        panels.append(DotPanel(measured.label, dots))
    alternatives = [POLICY_NAMES.get(policy, policy) for policy in policies]
    return [
        Illustration(
            "policies",
            dot_figure(panels, alternatives, styles),
            "How the mode is chosen, at the reported w. Lines: 95 % intervals over courses and "
            "training seeds; ticks: seeds.",
        )
    ]


def _latent_ticks(latents: list[int]) -> dict[float, str]:
    return {float(n): str(n) for n in latents}


def _ends(found: Measure) -> tuple[float, float]:
    low = found.value if found.low is None or not np.isfinite(found.low) else found.low
    high = found.value if found.high is None or not np.isfinite(found.high) else found.high
    return low, high
