"""Stage 5: the HTML report of a data set, its models and its rollouts."""

import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

from lmtr.models.trained import TrainedModel
from pipelines.config import Configuration
from pipelines.datasets import configuration_of, robot_of
from pipelines.learning_data import LearningData, learning_data
from pipelines.progress import bar, say
from pipelines.provenance import code_version
from pipelines.registry import evaluation_ids, load, models
from pipelines.report_films import films
from pipelines.report_page import PAGE, ReportContent, Section, write_report
from pipelines.report_sections import (
    comparison_section,
    dataset_section,
    headline,
    rollout_section,
    training_section,
)
from pipelines.results import Evaluation, evaluations, expert_reference
from pipelines.workspace import Workspace


def report(
    config: Configuration,
    workspace: Workspace,
    dataset_id: str,
    model_ids: Sequence[str] | None = None,
    chosen: Sequence[str] | None = None,
) -> Path:
    """Write the report of a data set; returns its page.

    Args:
        config: What made the data; it is stored beside the report.
        workspace: The home.
        dataset_id: The data set.
        model_ids: Models to report; None for all of the data set.
        chosen: Evaluations to report; None for all of the data set.

    Raises:
        DataError: Segments, models or evaluations are missing.
        ModelError: A model is damaged.
    """
    data = learning_data(config, workspace, dataset_id)
    if chosen is None:
        chosen = evaluation_ids(workspace, dataset_id, data.segmentation_id)
    tried = evaluations(workspace, chosen)
    trained = [
        (known.label, load(workspace, known.model_id))
        for known in models(workspace, dataset_id, data.segmentation_id, model_ids)
    ]
    with tempfile.TemporaryDirectory() as scratch:
        content = ReportContent(
            title=f"LMTR report: {dataset_id}",
            summary=headline(tried),
            provenance=_provenance(workspace, data),
            sections=_sections(workspace, dataset_id, trained, tried, Path(scratch)),
            reproduce=_reproduce(config, workspace),
        )
        page = _write(content, config, workspace.home.reports / dataset_id)
    say(f"report: {page}")
    return page


def _sections(
    workspace: Workspace,
    dataset_id: str,
    trained: list[tuple[str, TrainedModel]],
    tried: list[Evaluation],
    scratch: Path,
) -> list[Section]:
    recorded = configuration_of(workspace, dataset_id)
    robot = recorded.dataset.robot
    rows = workspace.lake.read(
        "solutions", where=f"dataset_id = '{dataset_id}'", order_by="index"
    ).to_pylist()
    with bar("Drawing the report", 4) as progress:
        sections = [dataset_section(rows, recorded.quality)]
        progress.advance(note="expert data")
        sections.append(training_section(trained))
        progress.advance(note="training")
        sections.append(rollout_section(tried, films(rows, tried, robot, scratch)))
        progress.advance(note="rollouts")
        sections.append(comparison_section(tried, expert_reference(rows, robot)))
        progress.advance(note="comparison")
    return sections


def _provenance(workspace: Workspace, data: LearningData) -> list[tuple[str, str]]:
    lake = workspace.lake
    tables = ("solutions", "segments", "models", "evaluations", "rollouts")
    return [
        ("data set", data.dataset_id),
        ("robot", robot_of(workspace, data.dataset_id).name),
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
