"""The sections of a configuration that belong to stages, beside those of the science's settings."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError, ValidationInfo, field_validator, model_validator

from lmtr.errors import ConfigurationError
from lmtr.models.settings import ModelSettings, ModeRegressorSettings, TrainingSettings
from lmtr.policies.distance import TaskWeights
from lmtr.replanners.selecting import Selection
from lmtr.robot.model import ROBOTS, RobotModel
from lmtr.rollout.settings import Criteria, RolloutSettings
from lmtr.settings import Count, Seed, Settings
from pipelines.tuning_settings import TuningSection
from services.cluster.delivery import Rhythm

PolicyName = Literal["nearest", "selected", "gaussian", "prior", "zero"]


class DatasetSection(Settings):
    """Which expert data set to make.

    Attributes:
        name: First part of the data set's id.
        solutions: How many tasks to solve.
        seed: Seed of all tasks and noise.
        robot: Name of a built-in robot, or a table with a robot's figures.
    """

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_]*$", max_length=40)] = "default"
    solutions: Count = 200
    seed: Seed = 0
    robot: RobotModel = ROBOTS["anymal"]

    @field_validator("robot", mode="before")
    @classmethod
    def _named_robot(cls, robot: object) -> object:
        if not isinstance(robot, str):
            return robot
        if robot not in ROBOTS:
            raise ValueError(
                f"no built-in robot is called {robot!r}; choose one of {', '.join(ROBOTS)} or "
                "give a [dataset.robot] table"
            )
        return ROBOTS[robot]


class TrainingSection(Settings):
    """Which models to train.

    Attributes:
        latent: Latent dimensions n, one model each; 0 is the unimodal regressor.
        seeds: Training seeds, one model each.
        validation_share: Share of the solutions held out (never single segments).
        segments: At most so many training segments, drawn at random from all solutions; a smaller
            number gives a part of what a larger one does. None takes all.
        mirror: Add the left-right mirror image of every training segment.
        model: Architecture and loss shared by all; ``latent`` stands above.
        optimizer: Optimisation shared by all; ``seeds`` stand above.
    """

    latent: Annotated[tuple[Annotated[int, Field(ge=0)], ...], Field(min_length=1)] = (
        0,
        3,
        6,
    )
    seeds: Annotated[tuple[Seed, ...], Field(min_length=1)] = (0,)
    validation_share: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.1
    segments: Annotated[int, Field(ge=2)] | None = None
    mirror: bool = True
    model: ModelSettings = ModelSettings()
    optimizer: TrainingSettings = TrainingSettings()

    @field_validator("model", "optimizer", mode="before")
    @classmethod
    def _said_once(cls, value: object, info: ValidationInfo) -> object:
        own, above = {"model": ("latent", "latent"), "optimizer": ("seed", "seeds")}[
            info.field_name or ""
        ]
        if isinstance(value, Mapping) and own in value:
            raise ValueError(
                f"{own!r} is not set here, got {value[own]!r}; give training.{above} as a list"
            )
        return value

    @field_validator("latent", "seeds")
    @classmethod
    def _none_twice(cls, values: tuple[int, ...], info: ValidationInfo) -> tuple[int, ...]:
        if len(set(values)) < len(values):
            raise ValueError(
                f"{info.field_name} must name each value once, got {list(values)}; drop repetitions"
            )
        return values

    @model_validator(mode="after")
    def _every_model_is_possible(self) -> "TrainingSection":
        for latent in self.latent:
            try:
                self._model_of(latent)
            except ValidationError as error:
                raise ValueError(error.errors()[0]["msg"].removeprefix("Value error, ")) from error
        return self

    def plans(self) -> list[tuple[ModelSettings, TrainingSettings]]:
        """Settings of each model: every latent dimension with every seed."""
        return [
            (self._model_of(latent), self.optimizer.model_copy(update={"seed": seed}))
            for latent in self.latent
            for seed in self.seeds
        ]

    def _model_of(self, latent: int) -> ModelSettings:
        return ModelSettings.model_validate({**self.model.model_dump(), "latent": latent})


def _task_weights(values: Sequence[float]) -> object:
    """A vector w as TOML has it, by its four numbers."""
    try:
        return TaskWeights.of(values)
    except ConfigurationError as error:
        raise ValueError(f"{error}; give each of them one") from error


class EvaluationSection(Settings):
    """How replanners are compared.

    Attributes:
        rollouts: Rollouts per replanner, one obstacle course each, the same for all.
        seed: Seed of the courses and starts.
        with_library: Whether the trajectory library is evaluated too.
        weights: Distance weights w of the nearest-neighbour look-ups, one evaluation each; by name,
            or four numbers in the order χ_base, χ_feet, η, γ.
        policies: How LMTR selects its modes, one evaluation each: ``nearest`` is π_nbr,
            ``selected`` takes the cheapest of several nearest, ``gaussian`` is π_N, ``prior`` and
            ``zero`` are controls that do not look at the task. The library has the first two.
        selection: How the cheapest is told.
        mode_regressor: How π_N is fitted.
        rollout: The testbed.
        criteria: What counts as a close step and as a violated range of motion.
        tuning: Search for further weights w of ``nearest``; none, or ``false``, keeps to
            ``weights``.
        keep_motions: Of so many rollouts per replanner the sampled motion is kept, of those that
            reached their end first; figures and films need one, comparisons none.
        expert_courses: On the first so many courses the expert is asked to walk too, offline and a
            stretch at a time, as the line of reference.
    """

    rollouts: Count = 100
    seed: Seed = 0
    with_library: bool = True
    weights: Annotated[tuple[TaskWeights, ...], Field(min_length=1)] = (TaskWeights(),)
    policies: Annotated[tuple[PolicyName, ...], Field(min_length=1)] = ("nearest",)
    selection: Selection = Selection()
    mode_regressor: ModeRegressorSettings = ModeRegressorSettings()
    rollout: RolloutSettings = RolloutSettings()
    criteria: Criteria = Criteria()
    tuning: TuningSection | None = None
    keep_motions: Annotated[int, Field(ge=0)] = 10
    expert_courses: Annotated[int, Field(ge=0)] = 0

    @field_validator("weights", mode="before")
    @classmethod
    def _vectors_of_four(cls, weights: object) -> object:
        if not isinstance(weights, list | tuple):
            return weights
        if weights and all(isinstance(each, int | float) for each in weights):
            raise ValueError(
                f"weights must be a list of vectors w, got the numbers {list(weights)}; put them "
                "into another pair of brackets"
            )
        return [_task_weights(each) if isinstance(each, list | tuple) else each for each in weights]

    @field_validator("tuning", mode="before")
    @classmethod
    def _or_not_at_all(cls, tuning: object) -> object:
        # TOML has no word for none, by which a variant could do without.
        return None if tuning is False else tuning

    @model_validator(mode="after")
    def _tuned_on_other_courses(self) -> "EvaluationSection":
        if self.tuning is not None and self.tuning.seed == self.seed:
            raise ValueError(
                f"tuning.seed must differ from evaluation.seed, got {self.seed} for both, or "
                "weights would be chosen on the courses that are reported; change one of them"
            )
        return self

    @model_validator(mode="after")
    def _what_is_tuned_is_evaluated(self) -> "EvaluationSection":
        if self.tuning is not None and "nearest" not in self.policies:
            raise ValueError(
                f"tuning searches the weights of policy 'nearest', which is not among policies "
                f"{list(self.policies)}; add it or leave tuning out"
            )
        return self

    @model_validator(mode="after")
    def _expert_walks_courses_there_are(self) -> "EvaluationSection":
        if self.expert_courses > self.rollouts:
            raise ValueError(
                f"expert_courses must not exceed the {self.rollouts} rollouts, got "
                f"{self.expert_courses}; lower it"
            )
        return self

    def for_tuning(self) -> "EvaluationSection":
        """The same testbed on the tuning's courses, for its grid.

        Raises:
            ValueError: Nothing is tuned.
        """
        if self.tuning is None:
            raise ValueError("this evaluation has no tuning; give it a tuning section")
        changes = {
            "rollouts": self.tuning.rollouts,
            "seed": self.tuning.seed,
            "weights": tuple(self.tuning.grid()),
            "policies": ("nearest",),
            "tuning": None,
            "keep_motions": 0,
            "expert_courses": 0,
        }
        return self.model_copy(update=changes)

    @field_validator("policies")
    @classmethod
    def _none_twice(cls, policies: tuple[PolicyName, ...]) -> tuple[PolicyName, ...]:
        if len(set(policies)) < len(policies):
            raise ValueError(
                f"policies must name each one once, got {list(policies)}; drop repetitions"
            )
        return policies


class ClusterSection(Settings):
    """Where the work runs.

    Attributes:
        address: Address of a running Ray cluster; none starts one on this machine.
        workers: Worker processes; none means one per core.
        batch_seconds: Work that a worker is handed at once takes about so long (s).
        commit_items: So many solutions, or groups of ten that are cut, are committed to the lake
            together, more while it is busy.
        commit_seconds: Rows are committed at least this often (s): what a power cut may cost.
        uncommitted_mb: Workers pause while so much waits to be committed, and half of it is
            committed (MB).
        cache: Absolute folder of compiled experts on every host, writable by its user alone; none
            takes ``LMTR_CACHE`` or the user's own folder of caches.
    """

    address: str | None = None
    workers: Annotated[int, Field(ge=0)] | None = None
    batch_seconds: Annotated[float, Field(gt=0.0, le=600.0)] = 2.0
    commit_items: Count = 500
    commit_seconds: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] = 10.0
    uncommitted_mb: Annotated[float, Field(gt=0.0, le=10_000.0)] = 64.0
    cache: Path | None = None

    @property
    def rhythm(self) -> Rhythm:
        """Sizes of batches and commits."""
        return Rhythm(
            self.batch_seconds,
            self.commit_items,
            self.commit_seconds,
            int(self.uncommitted_mb * 1e6),
        )

    @field_validator("cache")
    @classmethod
    def _same_from_everywhere(cls, cache: Path | None) -> Path | None:
        if cache is not None and not cache.expanduser().is_absolute():
            raise ValueError(
                f"cache must be an absolute path, since workers run in other folders, got {cache}; "
                "begin it with / or ~"
            )
        return cache
