"""All stages in a row: from a configuration, or a study of several, to a report."""

import time
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from pipelines.config import Configuration, settings_digest
from pipelines.evaluate import evaluate
from pipelines.generate import generate
from pipelines.invocation import command, short
from pipelines.learning_data import LearningData, learning_data
from pipelines.progress import say
from pipelines.report import report
from pipelines.results import Part, results
from pipelines.segment import segment
from pipelines.stage_times import StageTimes
from pipelines.study import BASE, Study
from pipelines.train import train
from pipelines.trials import LOOKS_UP
from pipelines.workspace import Workspace

STAGES = "stages.json"
"""File of a study's folder with the time that each stage took."""


@dataclass(frozen=True)
class Made:
    """What one configuration of a study made.

    Attributes:
        config: The configuration.
        data: Its data set, read.
        model_ids: Its models.
        evaluation_ids: Its evaluations.
    """

    config: Configuration
    data: LearningData
    model_ids: list[str]
    evaluation_ids: list[str]


def run(study: Study, workspace: Workspace) -> Path:
    """Generate, segment, train, evaluate, report; returns the report's page.

    A study, that is a configuration with variants or a search for weights, gets a page of results
    beside the report of its base.

    Every stage skips what is done, so an interrupted run goes on where it stopped.
    """
    began = time.monotonic()
    times = stage_times(study, workspace)
    made = {}
    with ExitStack() as shared:
        if len(study.configurations) > 1 and workspace.cluster_settings.workers != 0:
            # Stages share a Ray that runs already; starting one for each would take minutes.
            shared.enter_context(workspace.cluster(study.base.dataset.solutions))
        for name, config in study.configurations.items():
            if len(study.configurations) > 1:
                say(f"\n{study.name}: {name}")
            made[name] = _make(name, config, workspace, times)
    base = made[BASE]
    is_study = len(made) > 1 or base.config.evaluation.tuning is not None
    with times.of(BASE, "report"):
        shown = _side_by_side(workspace, base) if is_study else base
        page = report(workspace, base.data, shown.model_ids, shown.evaluation_ids, base.config)
    findings = None
    if is_study:
        with times.of(BASE, "results"):
            parts = [
                Part.of(name, each.config, each.data, each.model_ids, each.evaluation_ids)
                for name, each in made.items()
            ]
            findings = results(study.name, workspace, parts, times.seconds)
    say(f"\nDone in {time.monotonic() - began:.0f} s.")
    times.tell()
    say(f"Report:      {short(page)}")
    if findings is not None:
        say(f"Results:     {short(findings)}")
    say(f"Experiments: {command(workspace)} ui")
    say(
        f"A query:     {command(workspace)} query \"SELECT replanner, summary['close_share'] AS "
        'close FROM evaluations ORDER BY close"'
    )
    return page


def stage_times(study: Study, workspace: Workspace) -> StageTimes:
    """What the stages of a study took so far."""
    digests = {name: settings_digest(config) for name, config in study.configurations.items()}
    return StageTimes(workspace.home.reports / study.name / STAGES, digests)


def _make(name: str, config: Configuration, workspace: Workspace, times: StageTimes) -> Made:
    """All stages of one configuration but for the report."""
    with times.of(name, "generate"):
        dataset_id = generate(config, workspace)
    with times.of(name, "segment"):
        segment(config, workspace, dataset_id)
        data = learning_data(config, workspace, dataset_id)
    with times.of(name, "train"):
        model_ids = train(config, workspace, data)
    with times.of(name, "evaluate"):
        evaluation_ids = evaluate(config, workspace, data, model_ids)
    return Made(config, data, model_ids, evaluation_ids)


def _side_by_side(workspace: Workspace, made: Made) -> Made:
    """Of the many models and evaluations of a study those that a report can show together.

    They are the first training seed's, of the latent dimensions that are tuned, at the first w.
    """
    section, training = made.config.evaluation, made.config.training
    tuned = section.tuning.latent if section.tuning is not None else None
    latents = {0, *(tuned or training.latent)}
    listed = ", ".join(f"'{each}'" for each in made.evaluation_ids)
    rows = workspace.lake.read(
        "evaluations",
        ["evaluation_id", "model_id", "latent", "training_seed", "policy", "weights"],
        where=f"evaluation_id IN ({listed})",
    ).to_pylist()
    chosen = {
        row["evaluation_id"]: row["model_id"]
        for row in rows
        if row["policy"] in LOOKS_UP
        and (row["latent"] is None or row["latent"] in latents)
        and row["training_seed"] in (None, training.seeds[0])
        and tuple(row["weights"]) == section.weights[0].values
    }
    return replace(
        made,
        model_ids=[each for each in made.model_ids if each in chosen.values()],
        evaluation_ids=[each for each in made.evaluation_ids if each in chosen],
    )
