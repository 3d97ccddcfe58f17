"""Where the quality filter's thresholds lie in the distributions, and what each of them removes.

    python benchmarks/thresholds.py --tasks 300 --out build/thresholds
    python benchmarks/thresholds.py --redraw --record --out build/thresholds  # of the same solves

Solves default tasks, as many varied ones (up to four lines, goals near and far) and a few tasks
from several guesses each. Prints the share that every threshold removes, suggests thresholds by
quantiles, and fits the expected cost anew; ``--record`` keeps picture and summary for the docs.
"""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from benchmarks.filtering.costs import Draws, Groups, by_difficulty, compare_draws
from benchmarks.filtering.picture import thresholds_picture
from benchmarks.filtering.removal import (
    Removal,
    removals,
    saturation,
    suggestions,
    two_digits,
    verdicts,
)
from benchmarks.filtering.solves import (
    DISTRIBUTIONS,
    SEEDS,
    Amount,
    Kind,
    Solve,
    costs,
    features,
    of_kind,
    read,
    solve_all,
    write,
)
from benchmarks.solving.circumstances import (
    JUDGEMENT,
    Circumstances,
    circumstances,
    require_same,
    verdict_by,
)
from benchmarks.solving.ready import ready_expert
from lmtr.errors import DataError, LmtrError
from lmtr.expert.settings import ExpertSettings
from lmtr.figures.style import RESOLUTION
from lmtr.quality.cost_model import FEATURES, CostModel, fit_cost_model
from lmtr.quality.filter import QualityThresholds
from lmtr.robot.model import ANYMAL

ROOT = Path(__file__).resolve().parent.parent
PICTURE = ROOT / "docs" / "images" / "thresholds.png"
RECORD = ROOT / "benchmarks" / "results" / "thresholds.json"

console = Console()


@dataclass(frozen=True)
class Study:
    """Everything that the solves say of the thresholds.

    Attributes:
        model: The expected cost, fitted anew.
        suggested: The thresholds that quantiles suggest, by name.
        found: What each rule removes from default tasks now.
        saturated: Share of default tasks on each limit.
        accepted: Share of each kind of task that is accepted now.
        would_accept: Share of each that the suggested thresholds accept.
        spread: Standard deviation of the excess over the fitted cost, by kind.
        draws: Repeated solves of a few tasks.
        difficulty: What ways to judge costs remove by distance and by lines.
    """

    model: CostModel
    suggested: dict[str, float]
    found: list[Removal]
    saturated: dict[str, float]
    accepted: dict[str, float]
    would_accept: dict[str, float]
    spread: dict[str, float]
    draws: Draws
    difficulty: tuple[Groups, Groups]


def main(
    out: Annotated[Path, typer.Option(help="Folder for solves, picture and summary.")],
    tasks: Annotated[int, typer.Option(min=40, help="Default tasks, and as many varied.")] = 300,
    repeated: Annotated[int, typer.Option(min=2, help="Tasks solved from several guesses.")] = 15,
    draws: Annotated[int, typer.Option(min=2, help="Guesses of each of these.")] = 8,
    keep: Annotated[float, typer.Option(help="Share a suggested threshold keeps.")] = 0.985,
    keep_cost: Annotated[float, typer.Option(help="Share the suggested cost keeps.")] = 0.9,
    cache: Annotated[
        Path | None, typer.Option(help="Folder of compiled problems; else this machine's.")
    ] = None,
    redraw: Annotated[bool, typer.Option("--redraw", help="Use the solves kept there.")] = False,
    record: Annotated[bool, typer.Option("--record", help="Keep for the docs.")] = False,
) -> None:
    """Solve, or read solves; print what thresholds remove; draw and suggest."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        kept = out / "solves.json"
        if not redraw:
            expert = ready_expert(ANYMAL, ExpertSettings(), cache, console)
            made = present(tasks, expert.compiled)
            solves = solve_all(expert, Amount(tasks, tasks, repeated, draws))
            write(kept, made, expert.settings.cost_key(ANYMAL), solves)
        made, cost_key, solves = read(kept)
        if record:
            require_same(made, present(made.tasks, made.compiled), "thresholds", "--record")
        report(made, cost_key, solves, (keep_cost, keep), out, record)
    except LmtrError as error:
        console.print(f"error: {error}", style="red", markup=False, soft_wrap=True)
        raise typer.Exit(1) from error


def present(tasks: int, compiled: bool) -> Circumstances:
    """The present code and settings but for thresholds, which are drawn over kept solves."""
    settings = {
        "robot": ANYMAL,
        "tasks": [each.model_dump(mode="json") for each in DISTRIBUTIONS.values()],
        "expert": ExpertSettings(),
        "features": FEATURES,
    }
    seed = SEEDS[Kind.DEFAULT]
    return circumstances(settings, seed, tasks, compiled=compiled, without=JUDGEMENT)


def report(
    made: Circumstances,
    cost_key: str,
    solves: list[Solve],
    quantiles: tuple[float, float],
    out: Path,
    record: bool,
) -> None:
    """Print, draw and write what the solves say."""
    study = study_of(cost_key, solves, quantiles)
    thresholds = QualityThresholds()
    console.print(removal_table(study))
    console.print(paste(study), markup=False, highlight=False)
    picture = thresholds_picture(
        study.found,
        study.accepted[Kind.DEFAULT],
        study.draws,
        study.difficulty,
        thresholds.cost_excess,
    )
    found = summary_of(cost_key, solves, study, thresholds)
    told = {"circumstances": asdict(made), "verdict": verdict_by(thresholds)}
    summary = json.dumps(told | found, indent=1)
    targets = [(out / "thresholds.png", out / "thresholds.json")]
    if record:
        targets.append((PICTURE, RECORD))
    for image, text in targets:
        text.parent.mkdir(parents=True, exist_ok=True)
        picture.savefig(image, dpi=RESOLUTION)
        text.write_text(summary + "\n")
        console.print(f"wrote {image} and {text}", markup=False)


def study_of(cost_key: str, solves: list[Solve], quantiles: tuple[float, float]) -> Study:
    """Judge the solves by the present thresholds and by the suggested ones.

    Raises:
        DataError: There are too few converged solves to fit the expected cost.
    """
    fitted_to = of_kind(solves, Kind.DEFAULT, Kind.VARIED)
    model = fit_cost_model(features(fitted_to), costs(fitted_to), ANYMAL.name, cost_key)
    if model is None:
        raise DataError(f"thresholds: {len(fitted_to)} converged solves are too few; solve more")
    default = of_kind(solves, Kind.DEFAULT)
    varied = of_kind(solves, Kind.VARIED)
    thresholds = QualityThresholds()
    # The present model says nothing of costs of another kind; then the new one judges them.
    present = thresholds.cost_model if thresholds.cost_model.cost_key == cost_key else model
    excess = model.excess(costs(default), model.predict(features(default)))
    update = suggestions([default, varied], quantiles[1])
    update["cost_excess"] = two_digits(float(np.quantile(excess, quantiles[0])), up=True)
    suggested = thresholds.model_copy(update={**update, "cost_model": model})
    judged = verdicts(fitted_to, thresholds, present.predict(features(fitted_to)))
    refused = np.array([not verdict.accepted for verdict in judged])
    return Study(
        model=model,
        suggested=update,
        found=removals(default, thresholds, present.predict(features(default))),
        saturated=saturation(default),
        accepted=_accepted(solves, thresholds, present),
        would_accept=_accepted(solves, suggested, model),
        spread={
            kind: float(np.std(costs(mine) / model.predict(features(mine))))
            for kind in Kind
            if (mine := of_kind(solves, kind))
        },
        draws=compare_draws(solves, model),
        difficulty=by_difficulty(fitted_to, model, quantiles[0], refused),
    )


def _accepted(
    solves: list[Solve], thresholds: QualityThresholds, model: CostModel
) -> dict[str, float]:
    shares = {}
    for kind in Kind:
        mine = [s for s in solves if s.kind == kind]
        if mine:
            judged = verdicts(mine, thresholds, model.predict(features(mine)))
            shares[str(kind)] = float(np.mean([verdict.accepted for verdict in judged]))
    return shares


def removal_table(study: Study) -> Table:
    """Every figure with its quantiles, its threshold, and what that refuses: in all, and alone."""
    table = Table(title="Default tasks, converged; SI units and weights", title_justify="left")
    table.add_column("figure", no_wrap=True)
    for name in ("median", "p95", "worst", "limit", "beyond %", "alone %"):
        table.add_column(name, justify="right", no_wrap=True)
    for each in study.found:
        sign = -1.0 if each.rule.at_least else 1.0
        quantiles = sign * np.quantile(sign * each.values, [0.5, 0.95, 1.0])
        table.add_row(
            each.rule.figure,
            *(f"{value:.2g}" for value in quantiles),
            f"{each.threshold:g}",
            f"{100.0 * each.alone:.1f}",
            f"{100.0 * each.additional:.1f}",
        )
    for reason, share in study.saturated.items():
        table.add_row(reason, "", "", "", "", f"{100.0 * share:.1f}", "")
    return table


def paste(study: Study) -> str:
    """Figures that may be taken over into the code, and what they would come to."""
    lines = ["Suggested thresholds:"]
    lines += [f"    {name}: NonNegative = {value:g}" for name, value in study.suggested.items()]
    lines.append("\nExpected cost, fitted anew:\nDEFAULT_COST_MODEL = CostModel(")
    for name, value in study.model.model_dump().items():
        shown = f"{round(value, 4):.3g}" if isinstance(value, float) else f'"{value}"'
        lines.append(f"    {name}={shown},")
    lines.append(")\n\nAccepted now, and with the suggestions:")
    for kind, share in study.accepted.items():
        lines.append(f"    {kind}: {share:.1%}, {study.would_accept[kind]:.1%}")
    lines.append("\nSpread of costs around the fitted expectation, as a share of it:")
    lines += [f"    {kind}: {spread:.1%}" for kind, spread in study.spread.items()]
    lines.append("\nDraws of one task against each other:")
    lines += [f"    {name}: {value:.3g}" for name, value in draws_summary(study.draws).items()]
    return "\n".join(lines)


def draws_summary(draws: Draws) -> dict[str, float]:
    """How well the expected cost tells poor draws from good ones."""
    return {
        "spread within a task": draws.within,
        "spread of tasks' means around the expected cost": draws.between,
        "correlation of excess over expected and over best": draws.correlation,
        "chance to rank a poor draw above another, by excess": draws.ranking(draws.over_expected),
        "the same by the cost itself": draws.ranking(draws.raw),
        "share of poor ones among those refused": draws.precision(QualityThresholds().cost_excess),
    }


def summary_of(
    cost_key: str, solves: list[Solve], study: Study, thresholds: QualityThresholds
) -> dict[str, Any]:
    """What the study comes to, for a file."""
    return {
        "cost_key": cost_key,
        "solves": {kind: sum(s.kind == kind for s in solves) for kind in Kind},
        "accepted": study.accepted,
        "rules": {
            each.rule.figure: {
                "reason": each.rule.reason,
                "unit": each.rule.unit,
                "median": float(np.median(each.values)),
                "threshold": each.threshold,
                "refuses": each.alone,
                "refuses_alone": each.additional,
            }
            for each in study.found
        },
        "saturated": study.saturated,
        "suggested": study.suggested,
        "cost_model": study.model.model_dump(),
        "draws": draws_summary(study.draws),
        "refused_for_cost": {
            name: vars(groups)
            for name, groups in zip(("by_distance", "by_lines"), study.difficulty, strict=True)
        },
        "thresholds": thresholds.model_dump(),
    }


if __name__ == "__main__":
    typer.run(main)
