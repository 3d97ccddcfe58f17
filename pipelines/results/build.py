"""The results of a study as one page: read from the lake, drawn, and put in place when whole."""

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

from lmtr.models.trained import TrainedModel
from lmtr.policies.distance import TaskWeights
from pipelines.config import Configuration
from pipelines.datasets import configuration_of
from pipelines.invocation import short
from pipelines.learning_data import learning_data
from pipelines.progress import bar, say
from pipelines.registry import load
from pipelines.results.blocks import Block, Chapter, Missing, Paragraph
from pipelines.results.claims import claims_chapter, targets_chapter
from pipelines.results.comparison import comparison_chapter
from pipelines.results.data import data_chapter
from pipelines.results.groups import Groups, read_groups
from pipelines.results.held_out import held_out_chapter
from pipelines.results.markdown import write_page
from pipelines.results.modes import modes_chapter
from pipelines.results.overview import Seconds, overview_chapter
from pipelines.results.parts import Part
from pipelines.results.ratios import ratio_chapter
from pipelines.results.rollouts import rollout_chapter, write_films
from pipelines.results.training import training_chapter
from pipelines.results.variants import variants_chapter
from pipelines.workspace import Workspace

FOLDER = "results"
FILMS = "films"

MODE_LATENTS = (3, 6, 12)
"""Models whose space of modes is looked into, where they were trained."""


def results(
    name: str,
    workspace: Workspace,
    parts: Sequence[Part],
    seconds: Seconds | None = None,
    *,
    films: bool = True,
) -> Path:
    """Write the results of a study; returns their page, ``reports/NAME/results/results.md``.

    What is missing is said on the page and left out.

    Args:
        name: The study.
        workspace: The home.
        parts: Its configurations and what they made; the base first.
        seconds: Times of stages, by part and stage.
        films: Whether to draw a film of each replanner, which takes about ten seconds each.
    """
    base = parts[0]
    folder = workspace.home.reports / name / FOLDER
    partial = folder.with_name(f".{FOLDER}.partial")
    groups = {
        part.name: read_groups(workspace, part.evaluation_ids, reported(part.config))
        for part in parts
    }
    shutil.rmtree(partial, ignore_errors=True)
    filmed = _films(workspace, base, groups[base.name], partial) if films else []
    with bar("Writing results", 1) as progress:
        chapters = [*_chapters(workspace, parts, groups, seconds or {}), Chapter("Films", filmed)]
        write_page(f"Results: {name}", _lead(name, parts), chapters, partial)
        progress.advance(note=name)
    shutil.rmtree(folder, ignore_errors=True)
    partial.rename(folder)
    page = folder / "results.md"
    say(f"results: {short(page)}")
    return page


def reported(config: Configuration) -> tuple[float, ...]:
    """The w that tables report: the configuration's first."""
    return config.evaluation.weights[0].values


def _chapters(
    workspace: Workspace,
    parts: Sequence[Part],
    groups: Mapping[str, Groups],
    seconds: Seconds,
) -> list[Chapter]:
    base = parts[0]
    mine, config = groups[base.name], base.config
    models = {model_id: load(workspace, model_id) for model_id in base.model_ids}
    chapters = [
        claims_chapter(mine),
        targets_chapter(mine),
        overview_chapter(workspace, parts, groups, seconds),
        data_chapter(workspace, parts),
        training_chapter(models),
        *_learnt(workspace, base, models),
        comparison_chapter(workspace, mine, config.evaluation.criteria),
        ratio_chapter(mine),
        variants_chapter(parts, groups),
    ]
    if mine.every:
        robot = configuration_of(workspace, base.dataset_id).dataset.robot
        chapters.append(rollout_chapter(workspace, mine, robot))
    return chapters


def _films(workspace: Workspace, base: Part, groups: Groups, folder: Path) -> list[Block]:
    """Draw the films, and show them."""
    if not groups.every:
        return []
    (folder / FILMS).mkdir(parents=True)
    robot = configuration_of(workspace, base.dataset_id).dataset.robot
    paths = write_films(workspace, groups, robot, folder / FILMS)
    return [Paragraph(f"![{path.stem}]({FILMS}/{path.name})") for path in paths]


def _learnt(workspace: Workspace, base: Part, models: Mapping[str, TrainedModel]) -> list[Chapter]:
    """Fig. 2, and plans for held-out tasks, of the first training seed of a few models."""
    first: dict[int, tuple[str, TrainedModel]] = {}
    for model_id, model in models.items():
        first.setdefault(model.latent, (model_id, model))
    several = {n: each for n, each in sorted(first.items()) if n >= 2}
    shown = dict([several[n] for n in several if n in MODE_LATENTS] or list(several.values())[:1])
    if not models:
        return []
    data = learning_data(base.config, workspace, base.dataset_id, base.segments_version)
    weights, robot = TaskWeights.of(reported(base.config)), next(iter(models.values())).robot
    if shown:
        modes = modes_chapter(shown, data, weights)
    else:
        text = "No model with two or more latent dimensions has been trained."
        modes = Chapter("The space of modes", [Missing(text)])
    close = base.config.evaluation.criteria.clearance
    unimodal = dict([first[0]] if 0 in first else [])
    return [modes, held_out_chapter(unimodal | shown, data, weights, robot, close)]


def _lead(name: str, parts: Sequence[Part]) -> list[str]:
    return [
        f"Written by `lmtr results {name}` from what the lake holds; nothing here "
        "was entered by hand. Intervals are 95 %. Every number stands in full precision, with "
        "the evaluations, models or data sets that it was read from, in `numbers.json`; figures "
        "are in `figures/` as PDF too, and films in `films/`.",
        _limits(parts[0].config),
        "Where an interval reads 0 (0–0), no such event was seen in any rollout; that there are "
        "none is not said. Intervals over three training seeds tend to be too narrow.",
        *(
            [f"The study has {len(parts)} configurations: {', '.join(p.name for p in parts)}."]
            if len(parts) > 1
            else []
        ),
    ]


def _limits(config: Configuration) -> str:
    """Two ranges of motion, without which violations cannot be read."""
    own, judged = config.dataset.robot.range_of_motion[0], config.evaluation.criteria.forward_limit
    return (
        f"The expert keeps feet within ±{own:g} m of neutral in forward direction, so all data do. "
        f"In rollouts of all replanners what is beyond ±{judged:g} m counts as violation."
    )
