"""The paper's claims and the study's targets, each beside what was measured.

Every verdict follows from numbers by a rule that is stated: nothing here knows the outcome.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from lmtr.rollout.comparison import Ratio, ratio
from pipelines.results.blocks import Chapter, Measure, Row, Table
from pipelines.results.groups import Group, Groups
from pipelines.results.measures import MEASURES
from pipelines.results.ratios import BEST, PLAIN, Pair, pairs, resolution

NOT_EVALUATED = "not evaluated"

NOT_JUDGED = "not judged"
"""Verdict on a number that says nothing, such as the ratio of zero by zero."""

PLATEAU = (6, 12)
"""Latent dimensions between which the paper sees a plateau."""

FLAT = 0.8
"""Avoidance counts as flat from one n to another if the close share keeps this much of itself."""

LOOSE = 0.10
"""The target for the best LMTR holds below this share of close steps of the library."""


@dataclass(frozen=True)
class Answer:
    """What was measured of a claim or target.

    Attributes:
        ours: The measured values in words.
        found: The number that decides, with its interval; None where nothing was measured.
        verdict: Whether it holds.
        ids: Evaluations behind it.
    """

    ours: str
    found: Measure | None
    verdict: str
    ids: Sequence[str] = ()


MISSING = Answer("–", None, NOT_EVALUATED)


def claims_chapter(groups: Groups) -> Chapter:
    """The paper's claims, answered."""
    table = _answered(
        groups,
        _CLAIMS,
        "claims",
        "The paper's claims. A ratio has its 95 % interval by paired bootstrap over courses and "
        "training seeds. A claim about a ratio holds if the whole interval does. "
        "The plateau holds where "
        f"the close share at n = {PLATEAU[1]} keeps at least {FLAT:g} of that at n = {PLATEAU[0]}. "
        "Where no n is named by the claim, LMTR is the plain one with the fewest close steps on "
        "these courses, which makes it look a little better than it is.",
        ["claim", "paper", "ours", "ratio (×)", "verdict"],
    )
    return Chapter("The paper's claims", [table])


def targets_chapter(groups: Groups) -> Chapter:
    """The study's targets with what was measured."""
    table = _answered(
        groups,
        _TARGETS,
        "targets",
        "Targets of the study. Along a front the least ratio is named of the levels that both "
        "reach. The best LMTR is held against each point of the library's front at no more close "
        "footholds, not at equally many. Where one plain LMTR stands for all, it is that with the "
        "fewest close footholds at the reported w. "
        "What is called best was chosen on the courses that it is reported on, among all n, "
        "policies and w's, which makes it look a little better than it is.",
        ["figure", "target", "ours", "measured", "verdict"],
    )
    return Chapter("Targets", [table])


def _answered(
    groups: Groups,
    questions: "Sequence[tuple[str, str, Answering]]",
    stem: str,
    caption: str,
    headers: list[str],
) -> Table:
    """A row for each answer to each question, beside what is expected."""
    rows = [
        Row([question, expected, a.ours, a.found, a.verdict], a.ids)
        for question, expected, answer in questions
        for a in answer(groups)
    ]
    return Table(stem, caption, headers, rows)


def at_least(found: Measure | Ratio, least: float) -> str:
    """Whether a ratio reaches a value, with its interval or by itself."""
    if np.isnan(found.value):
        return NOT_JUDGED
    if found.value < least:
        return "no"
    if found.low is not None and found.low >= least:
        return "yes"
    return "value yes, interval no"


def at_most(found: Measure, most: float) -> str:
    """Whether a number stays below a value, with its interval or by itself."""
    if np.isnan(found.value):
        return NOT_JUDGED
    if found.value > most:
        return "no"
    if found.high is None or found.high <= most:
        return "yes"
    return "value yes, interval no"


def no_worse(found: Ratio) -> str:
    """Whether a rate that shall be small is no larger than another one.

    An interval that holds 1 shows neither: with few courses it holds almost everything.
    """
    if np.isnan(found.value):
        return NOT_JUDGED
    if found.high <= 1.0:
        return "yes, and fewer"
    return "not told apart" if found.low <= 1.0 else "no"


def _against(
    a: Group | None, b: Group | None, rate: str, verdict: Callable[[Ratio], str]
) -> list[Answer]:
    """A rate of one group over that of another."""
    if a is None or b is None or a.tallies.shape[1] != b.tallies.shape[1]:
        return [MISSING]
    measured = MEASURES[rate]
    found = ratio(a.tallies, b.tallies, rate, resolution=resolution([b], rate))
    ours = " / ".join(f"{g.name} {measured.measure(g)} {measured.unit}" for g in (a, b))
    if np.isnan(found.value):
        return [Answer(ours, None, NOT_JUDGED, [*a.ids, *b.ids])]
    return [Answer(ours, Measure.of(found), verdict(found), [*a.ids, *b.ids])]


def _best_plain(groups: Groups) -> Group | None:
    """The plain LMTR with the fewest close steps at the reported w."""
    plain = [g for g in groups.shown if g.latent and g.policy == "nearest"]
    order = {g.name: (not _crossed(g), g.tallies.rate("close_share")) for g in plain}
    return min(plain, key=lambda g: order[g.name], default=None)


def _crossed(group: Group) -> bool:
    return bool(np.isfinite(group.tallies.rate("close_share")))


def _unimodal(groups: Groups) -> list[Answer]:
    return _against(
        groups.get(0), _best_plain(groups), "close_share", lambda found: at_least(found, 1.0)
    )


def _plateau(groups: Groups) -> list[Answer]:
    early, late = PLATEAU
    return _against(
        groups.get(late), groups.get(early), "close_share", lambda found: at_least(found, FLAT)
    )


def _matches(groups: Groups) -> list[Answer]:
    return _against(_best_plain(groups), groups.get(None), "close_share", no_worse)


def _milder(groups: Groups) -> list[Answer]:
    return [
        _least(pair, rate, 5.0) for pair in pairs(groups) if pair.kind == PLAIN for rate in _RATES
    ] or [MISSING]


_RATES = ("mean_violation", "large_violation_share")


def _least(pair: Pair, rate: str, target: float, below: float = 1.0) -> Answer:
    """The least ratio along a front, of the levels that most draws of both reach."""
    levels = [
        at for at in pair.levels[rate] if at.close_share <= below and not np.isnan(at.ratio.low)
    ]
    if not levels:
        return Answer(f"{pair.name}, {MEASURES[rate].name}: no common level", None, NOT_EVALUATED)
    worst = min(levels, key=lambda at: at.ratio.value)
    shares = [100.0 * at.close_share for at in levels]
    verdicts = [at_least(at.ratio, target) for at in levels]
    several = f"least of {len(levels)} levels" if len(levels) > 1 else "one level"
    low, high = (100.0 * end for end in pair.reach)
    ours = (
        f"{pair.name}, {MEASURES[rate].name}: {several} from {min(shares):.1f} to "
        f"{max(shares):.1f} % close footholds; the library's front has {low:.1f} to {high:.1f} %"
    )
    return Answer(ours, Measure.of(worst.ratio), _along(verdicts), pair.ids)


def _along(verdicts: Sequence[str]) -> str:
    """One verdict of those of all levels."""
    if len(set(verdicts)) == 1:
        return verdicts[0]
    reached = sum(verdict != "no" for verdict in verdicts)
    if reached == len(verdicts):
        return "values yes, not all intervals"
    return f"at {reached} of {len(verdicts)} levels"


def _memory(groups: Groups) -> list[Answer]:
    """Memory and time of a plan."""
    found = []
    for group, most in ((_best_plain(groups), 10.0), (groups.get(None), 60.0)):
        if group is None:
            found.append(MISSING)
            continue
        size = 1e-6 * group.summary("nbytes")
        ours = f"{group.name}: {size:.1f} MB; times: docs/benchmarks.md"
        verdict = "no larger" if size <= most else "larger"
        found.append(Answer(ours, None, verdict, group.ids))
    return found


def _best_at_loose(groups: Groups) -> list[Answer]:
    best = [pair for pair in pairs(groups) if pair.kind == BEST]
    return [_least(pair, rate, 10.0, LOOSE) for pair in best for rate in _RATES] or [MISSING]


def _both_selecting(groups: Groups) -> list[Answer]:
    """The library and the LMTR with the fewest close steps, each with its selection."""
    library = groups.get(None, "selected")
    mine = [g for n in groups.latents if n and (g := groups.get(n, "selected")) and _crossed(g)]
    best = min(mine, key=lambda g: g.tallies.rate("close_share"), default=None)
    return [
        answer
        for rate in ("close_share", *_RATES, "linear_residual", "pull_share")
        for answer in _against(library, best, rate, lambda _: "reported")
    ]


def _jumps(groups: Groups) -> list[Answer]:
    return [
        answer
        for rate in ("mean_velocity_jump", "mean_foot_jump")
        for answer in _against(
            groups.get(None), _best_plain(groups), rate, lambda found: at_least(found, 5.0)
        )
    ]


def _progress(groups: Groups) -> list[Answer]:
    """The least of what replanners keep of their distance when they select."""
    kinds: list[int | None] = [*(n for n in groups.latents if n), None]
    found = [
        answer
        for latent in kinds
        for answer in _against(
            groups.get(latent, "selected"),
            groups.get(latent),
            "distance",
            lambda found: at_least(found, 0.97),
        )
        if answer.found is not None
    ]
    if not found:
        return [MISSING]
    least = min(found, key=lambda each: each.found.value if each.found else np.inf)
    ours = f"least of {len(found)} replanners: {least.ours}"
    ids = [each for answer in found for each in answer.ids]
    return [Answer(ours, least.found, least.verdict, ids)]


def _safest(groups: Groups) -> list[Answer]:
    models = [g for g in groups.every if g.latent and _crossed(g)]
    if not models:
        return [MISSING]
    best = min(models, key=lambda g: (g.falls > 0, g.tallies.rate("close_share")))
    share = MEASURES["close_share"].measure(best)
    verdict = at_most(share, 1.0) if best.falls == 0 else "no"
    ours = f"{best.name}, w = {best.in_words}: {best.falls} of {best.rollouts} rollouts diverged"
    return [Answer(ours, share, verdict, best.ids)]


def _artifact(groups: Groups) -> list[Answer]:
    models = [g for g in groups.shown if g.latent and g.policy in ("nearest", "selected")]
    sizes = [(1e-6 * g.summary("nbytes"), g) for g in models]
    sizes = [each for each in sizes if np.isfinite(each[0])]
    if not sizes:
        return [MISSING]
    size, group = max(sizes, key=lambda each: each[0])
    verdict = at_most(Measure(size), 10.0)
    return [Answer(f"largest: {group.name}", Measure(size), verdict, group.ids)]


def _elsewhere(_: Groups) -> Iterator[Answer]:
    yield Answer("measured by hand: `benchmarks/`", None, "see docs/benchmarks.md")


Answering = Callable[[Groups], Sequence[Answer] | Iterator[Answer]]

_CLAIMS: tuple[tuple[str, str, Answering], ...] = (
    (
        "The unimodal regressor steps close to obstacles (close share over that of LMTR)",
        "commonly very close (Fig. 4 a)",
        _unimodal,
    ),
    (
        "Avoidance plateaus at 6 to 12 latent dimensions (close share at 12 over that at 6)",
        "plateau",
        _plateau,
    ),
    (
        "LMTR matches the library on obstacles (close share over that of the library)",
        "roughly the same",
        _matches,
    ),
    (
        "LMTR's kinematic violation is milder at equal avoidance (library over LMTR)",
        "about 5×",
        _milder,
    ),
    ("Look-up and regression are small and quick", "LMTR 10 MB, library 60 MB; 3 ms", _memory),
)

_TARGETS: tuple[tuple[str, str, Answering], ...] = (
    ("violation at equal avoidance, plain against plain", "≥ 5×", _milder),
    ("the same, best LMTR, below 10 % close steps", "≥ 10×", _best_at_loose),
    ("against the library with the same selection", "whatever is true", _both_selecting),
    ("jumps at replanning, library over LMTR", "≥ 5×", _jumps),
    ("distance, selecting over plain", "≥ 0.97", _progress),
    ("close footholds (%), best LMTR, none diverged", "≤ 1 %", _safest),
    ("memory that planning needs (MB)", "≤ 10", _artifact),
    ("time of one plan, of 100 rollouts, of one training", "see docs/benchmarks.md", _elsewhere),
)
