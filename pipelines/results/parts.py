"""The parts of a study: each configuration, and what it has made in the lake so far."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from lmtr.errors import LmtrError
from pipelines.config import Configuration
from pipelines.evaluate import planned_evaluations
from pipelines.learning_data import LearningData, learning_data
from pipelines.study import Study
from pipelines.train import jobs
from pipelines.workspace import Workspace


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
        """A part whose data have been read."""
        return cls(
            name,
            config,
            data.dataset_id,
            data.segmentation_id,
            data.version,
            len(data.training.x),
            len(data.validation.x),
            list(model_ids),
            list(evaluation_ids),
            list(missing),
        )
