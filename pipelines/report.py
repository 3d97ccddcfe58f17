"""Stage 5: the HTML report of a data set, its models and its rollouts."""

import shutil
from pathlib import Path

from lmtr.models import checkpoint
from lmtr.models.trained import TrainedModel
from pipelines.config import Configuration
from pipelines.datasets import robot_of
from pipelines.evaluate import trials
from pipelines.learning_data import LearningData, learning_data
from pipelines.progress import bar, say
from pipelines.provenance import code_version
from pipelines.report_page import PAGE, ReportContent, Section, write_report
from pipelines.report_sections import (
    comparison_section,
    dataset_section,
    headline,
    rollout_section,
    training_section,
)
from pipelines.results import Evaluation, evaluations, expert_reference
from pipelines.train import jobs
from pipelines.workspace import Workspace


def report(config: Configuration, workspace: Workspace, dataset_id: str) -> Path:
    """Write the report of what the configuration asks for; returns its page.

    Raises:
        DataError: Segments or evaluations of this configuration are missing.
        ModelError: One of its models is.
    """
    data = learning_data(config, workspace, dataset_id)
    tried = evaluations(workspace, [trial.evaluation_id for trial in trials(config, data)])
    content = ReportContent(
        title=f"LMTR report: {dataset_id}",
        summary=headline(tried),
        provenance=_provenance(workspace, data, config),
        sections=_sections(config, workspace, data, tried),
        reproduce=_reproduce(config, workspace),
    )
    page = _write(content, config, workspace.home.reports / dataset_id)
    say(f"report: {page}")
    return page


def _sections(
    config: Configuration, workspace: Workspace, data: LearningData, tried: list[Evaluation]
) -> list[Section]:
    robot = robot_of(workspace, data.dataset_id)
    rows = workspace.lake.read(
        "solutions", where=f"dataset_id = '{data.dataset_id}'", order_by="index"
    ).to_pylist()
    with bar("Drawing the report", 4) as progress:
        sections = [dataset_section(rows, config.quality)]
        progress.advance(note="expert data")
        sections.append(training_section(_models(config, workspace, data)))
        progress.advance(note="training")
        sections.append(rollout_section(tried))
        progress.advance(note="rollouts")
        sections.append(comparison_section(tried, expert_reference(rows, robot)))
        progress.advance(note="comparison")
    return sections


def _models(
    config: Configuration, workspace: Workspace, data: LearningData
) -> list[tuple[str, TrainedModel]]:
    return [
        (job.label, checkpoint.load(workspace.home.models / job.model_id))
        for job in jobs(config, data)
    ]


def _provenance(
    workspace: Workspace, data: LearningData, config: Configuration
) -> list[tuple[str, str]]:
    lake = workspace.lake
    tables = ("solutions", "segments", "models", "evaluations", "rollouts")
    return [
        ("data set", data.dataset_id),
        ("robot", config.dataset.robot.name),
        ("segments read", f"version {data.version}, cut {data.segmentation_id}"),
        ("table versions", ", ".join(f"{name} {lake.version(name)}" for name in tables)),
        ("code", code_version()),
    ]


def _write(content: ReportContent, config: Configuration, folder: Path) -> Path:
    """Write beside the present report and put it in its place when it is whole."""
    partial = folder.with_name(f".{folder.name}.partial")
    shutil.rmtree(partial, ignore_errors=True)
    write_report(content, partial)
    (partial / "configuration.json").write_text(config.model_dump_json(indent=2), encoding="utf-8")
    shutil.rmtree(folder, ignore_errors=True)
    partial.rename(folder)
    return folder / PAGE


def _reproduce(config: Configuration, workspace: Workspace) -> list[str]:
    home = f"lmtr --home {workspace.home.root}"
    return [
        f"{home} run {config.dataset.name}",
        f'{home} query "SELECT status, accepted, count(*) FROM solutions GROUP BY ALL"',
        f"{home} show solution 0",
        f"{home} ui",
    ]
