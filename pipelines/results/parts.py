"""The parts of a study: each configuration, and what it has made in the lake so far."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from lmtr.errors import LmtrError
from pipelines.config import Configuration
from pipelines.expert_courses import expert_id
from pipelines.learning_data import LearningData, learning_data
from pipelines.registry import is_trained, models
from pipelines.study import Study
from pipelines.train import jobs
from pipelines.trials import trials
from pipelines.tuning import choose, tuned_models
from pipelines.workspace import Workspace
from services.lake.tables import Lake


@dataclass(frozen=True)
class Part:
    """One configuration of a study and what it made.

    Attributes:
        name: Its name in the study.
        config: The configuration.
        dataset_id: Its data set.
        segmentation_id: How that was cut.
        segments_version: Version of the table ``segments`` that was read.
        training_rows: Pairs that its models learn from.
        validation_rows: Pairs held out.
        model_ids: Its models that are there.
        evaluation_ids: Its evaluations that are there.
        missing: What is not, in sentences.
    """

    name: str
    config: Configuration
    dataset_id: str
    segmentation_id: str = ""
    segments_version: int = 0
    training_rows: int = 0
    validation_rows: int = 0
    model_ids: Sequence[str] = ()
    evaluation_ids: Sequence[str] = ()
    missing: Sequence[str] = field(default_factory=tuple)

    @classmethod
    def of(
        cls,
        name: str,
        config: Configuration,
        data: LearningData,
        model_ids: Sequence[str],
        evaluation_ids: Sequence[str],
        missing: Sequence[str] = (),
    ) -> "Part":
        """A part whose data have been read; the expert's evaluation is added if it is asked for."""
        section = config.evaluation
        return cls(
            name,
            config,
            data.dataset_id,
            data.segmentation_id,
            data.version,
            len(data.training.x),
            len(data.validation.x),
            list(model_ids),
            [*evaluation_ids, *([expert_id(section, data)] if section.expert_courses else [])],
            list(missing),
        )


def found_parts(study: Study, workspace: Workspace) -> list[Part]:
    """What the lake holds of a study's configurations; nothing is made."""
    return [_found(name, config, workspace) for name, config in study.configurations.items()]


def _found(name: str, config: Configuration, workspace: Workspace) -> Part:
    try:
        data = learning_data(config, workspace, config.dataset_id)
    except LmtrError as error:
        return Part(name, config, config.dataset_id, missing=(f"{error}.",))
    missing = []
    wanted = [job.model_id for job in jobs(config, data)]
    trained = [model_id for model_id in wanted if is_trained(workspace, model_id)]
    if len(trained) < len(wanted):
        missing.append(f"{len(wanted) - len(trained)} of {len(wanted)} models are not trained yet.")
    evaluated: list[str] = []
    if trained:
        evaluated, absent = _evaluated(config, workspace, data, trained)
        missing += absent
    return Part.of(name, config, data, trained, evaluated, missing)


def _evaluated(
    config: Configuration, workspace: Workspace, data: LearningData, trained: Sequence[str]
) -> tuple[list[str], list[str]]:
    """Evaluations that are there of those that are asked for, and what is missing."""
    section, lake = config.evaluation, workspace.lake
    known = models(workspace, data.dataset_id, data.segmentation_id, trained)
    done = _whole(lake)
    missing, weights = [], None
    if section.tuning is not None:
        search = trials(section.for_tuning(), data, tuned_models(section, known), purpose="tuning")
        if all(trial.evaluation_id in done for trial in search):
            weights = choose(section, lake, search)
        else:
            missing.append("The search for w is not finished yet; its front is not shown.")
    wanted = [trial.evaluation_id for trial in trials(section, data, known, weights)]
    found = [each for each in wanted if each in done]
    if len(found) < len(wanted):
        missing.append(f"{len(wanted) - len(found)} of {len(wanted)} evaluations are not made yet.")
    return found, missing


def _whole(lake: Lake) -> set[str]:
    """Evaluations whose rollouts are there too."""
    if not (lake.exists("evaluations") and lake.exists("rollouts")):
        return set()
    return set(lake.values("evaluations", "evaluation_id")) & set(
        lake.values("rollouts", "evaluation_id")
    )
