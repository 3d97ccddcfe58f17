"""The report as a stage: read, draw, and put the page in its place when it is whole."""

import json
import shlex
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lmtr.models.trained import TrainedModel
from pipelines.config import Configuration, as_toml, fingerprint
from pipelines.datasets import configuration_of
from pipelines.invocation import command, short
from pipelines.learning_data import LearningData
from pipelines.progress import bar, say
from pipelines.provenance import code_version
from pipelines.records import Row
from pipelines.registry import evaluation_ids, load, models
from pipelines.report.comparison import comparison_section, headline
from pipelines.report.dataset import dataset_section
from pipelines.report.films import films
from pipelines.report.page import PAGE, ReportContent, Section, write_report
from pipelines.report.results import Evaluation, evaluations, expert_reference
from pipelines.report.rollouts import rollout_section
from pipelines.report.training import training_section
from pipelines.workspace import Workspace

CONFIGURATION = "configuration.toml"
PROVENANCE = "provenance.json"


def report(
    workspace: Workspace,
    data: LearningData,
    model_ids: Sequence[str] | None = None,
    chosen: Sequence[str] | None = None,
    config: Configuration | None = None,
) -> Path:
    """Write the report of a data set; returns its page.

    Args:
        workspace: The home.
        data: The data set and its cut.
        model_ids: Models to report; None for all of the data set.
        chosen: Evaluations to report; None for all of the data set.
        config: The configuration of the run that made all this, if it was one; then a report of
            the same things is left as it is.

    Raises:
        DataError: Models or evaluations are missing.
        ModelError: A model is damaged.
    """
    if chosen is None:
        chosen = evaluation_ids(workspace, data.dataset_id, data.segmentation_id)
    known = models(workspace, data.dataset_id, data.segmentation_id, model_ids)
    found = _Findings(
        recorded=configuration_of(workspace, data.dataset_id),
        rows=workspace.lake.read(
            "solutions", where=f"dataset_id = '{data.dataset_id}'", order_by="index"
        ).to_pylist(),
        trained=[(model.label, load(workspace, model.model_id)) for model in known],
        tried=evaluations(workspace, chosen),
    )
    folder = workspace.home.reports / data.dataset_id
    stamp = fingerprint(
        data.identity,
        len(found.rows),
        [model.model_id for model in known],
        list(chosen),
        None if config is None else config.model_dump(mode="json"),
        code_version(),
    )
    if config is not None and _stamp_of(folder) == stamp:
        say(f"report: {short(folder / PAGE)} is up to date")
        return folder / PAGE
    partial = folder.with_name(f".{folder.name}.partial")
    shutil.rmtree(partial, ignore_errors=True)
    with tempfile.TemporaryDirectory() as scratch:
        content = ReportContent(
            title=f"LMTR report: {data.dataset_id}",
            summary=headline(found.tried),
            provenance=_provenance(workspace, data, found),
            sections=_sections(data, found, Path(scratch)),
            reproduce=_reproduce(workspace, data, config),
        )
        write_report(content, partial)
    _write_settings(workspace, data, found, config, stamp, partial)
    shutil.rmtree(folder, ignore_errors=True)
    partial.rename(folder)
    say(f"report: {short(folder / PAGE)}")
    return folder / PAGE


@dataclass(frozen=True)
class _Findings:
    """What the lake holds of a data set.

    Attributes:
        recorded: The settings that the data set was made with.
        rows: Its solutions.
        trained: Labels and models.
        tried: Evaluations of replanners.
    """

    recorded: Configuration
    rows: list[Row]
    trained: list[tuple[str, TrainedModel]]
    tried: list[Evaluation]


def _sections(data: LearningData, found: _Findings, scratch: Path) -> list[Section]:
    robot = found.recorded.dataset.robot
    with bar("Drawing the report", 4) as progress:
        sections = [dataset_section(found.rows, found.recorded.quality)]
        progress.advance(note="expert data")
        sections.append(training_section(found.trained, data.validation))
        progress.advance(note="training")
        moving = films(found.rows, found.tried, robot, scratch)
        sections.append(rollout_section(found.tried, robot, moving))
        progress.advance(note="rollouts")
        criteria = found.tried[0].criteria
        expert = expert_reference(found.rows, robot, criteria)
        sections.append(comparison_section(found.tried, expert))
        progress.advance(note="comparison")
    return sections


def _provenance(
    workspace: Workspace, data: LearningData, found: _Findings
) -> list[tuple[str, str]]:
    lake = workspace.lake
    tables = ("solutions", "segments", "models", "evaluations", "rollouts")
    training_seeds = sorted({model.training.seed for _, model in found.trained})
    evaluation_seeds = sorted({each.seed for each in found.tried if each.seed is not None})
    codes = sorted({row["code_version"] for row in found.rows})
    return [
        ("data set", data.dataset_id),
        ("robot", found.recorded.dataset.robot.name),
        (
            "seeds",
            f"data {found.recorded.dataset.seed}, training {_listed(training_seeds)}, "
            f"courses {_listed(evaluation_seeds)}",
        ),
        ("segments read", f"version {data.version}, cut {data.segmentation_id}"),
        ("table versions", ", ".join(f"{name} {lake.version(name)}" for name in tables)),
        ("code that solved", _listed(codes)),
        ("code that reports", code_version()),
    ]


def _stamp_of(folder: Path) -> str | None:
    """What the report in a folder was made of; None if there is no whole one."""
    try:
        return str(json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))["stamp"])
    except (OSError, ValueError, KeyError):
        return None


def _listed(values: Sequence[object]) -> str:
    return ", ".join(map(str, values))


def _write_settings(
    workspace: Workspace,
    data: LearningData,
    found: _Findings,
    config: Configuration | None,
    stamp: str,
    folder: Path,
) -> None:
    """Keep beside the page all settings as they were recorded, and the run's configuration."""
    (cut,) = workspace.lake.values(
        "cuts",
        "settings",
        f"dataset_id = '{data.dataset_id}' AND segmentation_id = '{data.segmentation_id}'",
    )
    recorded = {
        "stamp": stamp,
        "dataset": found.recorded.model_dump(
            mode="json", include={"dataset", "tasks", "expert", "quality"}
        ),
        "cut": json.loads(cut),
        "models": {
            label: {
                "model": model.settings.model_dump(mode="json"),
                "optimizer": model.training.model_dump(mode="json"),
                "provenance": dict(model.provenance),
            }
            for label, model in found.trained
        },
        "evaluations": {
            each.label: {"testbed": each.settings, "planner": each.planner} for each in found.tried
        },
    }
    (folder / PROVENANCE).write_text(json.dumps(recorded, indent=2), encoding="utf-8")
    if config is not None:
        (folder / CONFIGURATION).write_text(as_toml(config), encoding="utf-8")


def _reproduce(workspace: Workspace, data: LearningData, config: Configuration | None) -> list[str]:
    home = command(workspace)
    again = f"{home} report --dataset {data.dataset_id}"
    if config is not None:
        file = short(workspace.home.reports / data.dataset_id / CONFIGURATION)
        again = f"{home} run {shlex.quote(str(file))}"
    return [
        again,
        f'{home} query "SELECT status, accepted, count(*) FROM solutions GROUP BY ALL"',
        f"{home} show solution {data.dataset_id}/0",
        f"{home} ui",
    ]
