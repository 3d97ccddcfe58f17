"""The one configuration of a run: a TOML file, checked whole before any work starts.

A configuration names every setting of every stage; what a file leaves out takes the documented
default. Settings classes live beside the code that consumes them.
"""

import difflib
import hashlib
import json
import math
import tomllib
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

import tomli_w
from pydantic import (
    BaseModel,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from lmtr import __version__
from lmtr.errors import ConfigurationError
from lmtr.expert.settings import ExpertSettings
from lmtr.models.settings import ModelSettings, TrainingSettings
from lmtr.policies.distance import TaskWeights
from lmtr.quality.filter import QualityThresholds
from lmtr.robot.model import ROBOTS, RobotModel
from lmtr.rollout.settings import Criteria, RolloutSettings
from lmtr.segmentation.segment import SegmentationSettings
from lmtr.settings import Count, Seed, Settings
from lmtr.task.sampling import TaskDistribution
from lmtr.task.task import reach


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


class EvaluationSection(Settings):
    """How replanners are compared.

    Attributes:
        rollouts: Rollouts per replanner, one obstacle course each, the same for all.
        seed: Seed of the courses and starts.
        with_library: Whether the trajectory library is evaluated too.
        weights: Distance weights w of the nearest-neighbour look-ups, one evaluation each.
        rollout: The testbed.
        criteria: What counts as a close step and as a violated range of motion.
    """

    rollouts: Count = 100
    seed: Seed = 0
    with_library: bool = True
    weights: Annotated[tuple[TaskWeights, ...], Field(min_length=1)] = (TaskWeights(),)
    rollout: RolloutSettings = RolloutSettings()
    criteria: Criteria = Criteria()


class ClusterSection(Settings):
    """Where the work runs.

    Attributes:
        address: Address of a running Ray cluster; none starts one on this machine.
        workers: Worker processes; none means one per core.
        commit_rows: Solutions that are committed to the lake together.
        commit_seconds: Solutions are committed at least this often (s).
        cache: Absolute folder of compiled experts on every host, writable by its user alone; none
            takes ``LMTR_CACHE`` or the user's own folder of caches.
    """

    address: str | None = None
    workers: Annotated[int, Field(ge=0)] | None = None
    commit_rows: Count = 25
    commit_seconds: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] = 20.0
    cache: Path | None = None

    @field_validator("cache")
    @classmethod
    def _same_from_everywhere(cls, cache: Path | None) -> Path | None:
        if cache is not None and not cache.expanduser().is_absolute():
            raise ValueError(
                f"cache must be an absolute path, since workers run in other folders, got {cache}; "
                "begin it with / or ~"
            )
        return cache


class Configuration(Settings):
    """Everything that decides what a run makes, and where it runs."""

    dataset: DatasetSection = DatasetSection()
    tasks: TaskDistribution = TaskDistribution()
    expert: ExpertSettings = ExpertSettings()
    quality: QualityThresholds = QualityThresholds()
    segmentation: SegmentationSettings = SegmentationSettings()
    training: TrainingSection = TrainingSection()
    evaluation: EvaluationSection = EvaluationSection()
    cluster: ClusterSection = ClusterSection()

    @model_validator(mode="after")
    def _tasks_are_possible(self) -> "Configuration":
        robot, tasks, swings = self.dataset.robot, self.tasks, self.expert.scope.n_swings
        furthest = math.hypot(tasks.goal_distance[1], tasks.goal_lateral)
        if furthest > reach(robot, swings):
            raise ValueError(
                f"tasks.goal_distance and goal_lateral put goals up to {furthest:.2f} m away, but "
                f"robot {robot.name!r} reaches at most {reach(robot, swings):.2f} m with {swings} "
                "swings per leg; bring the goals closer or allow more swings"
            )
        scatter, range_of_motion = tasks.foot_scatter, robot.range_of_motion[:2]
        if any(s > r for s, r in zip(scatter, range_of_motion, strict=True)):
            raise ValueError(
                f"tasks.foot_scatter {scatter} m leaves the range of motion ±{range_of_motion} m "
                f"of robot {robot.name!r}; scatter the start feet less"
            )
        return self

    @property
    def dataset_id(self) -> str:
        """Identity of the data set: name, seed and a digest of all that decides its rows.

        The version of LMTR is part of it; the number of solutions is left out, so that a data set
        can be extended.
        """
        digest = fingerprint(
            __version__,
            self.dataset.robot,
            self.tasks,
            self.expert,
            self.quality,
            self.dataset.seed,
        )
        return f"{self.dataset.name}-s{self.dataset.seed}-{digest}"

    @property
    def segmentation_id(self) -> str:
        """Identity of the way solutions are cut."""
        return fingerprint(self.segmentation, self.training.validation_share)


def fingerprint(*parts: object) -> str:
    """Eight hexadecimal digits of a digest of settings and plain values."""
    plain = [
        part.model_dump(mode="json") if isinstance(part, BaseModel) else part for part in parts
    ]
    text = json.dumps(plain, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:8]


def as_toml(config: Configuration) -> str:
    """The whole configuration, defaults included, as a file that :func:`load` reads back."""
    tree = config.model_dump(
        mode="json",
        exclude={"training": {"model": {"latent"}, "optimizer": {"seed"}}},
        exclude_none=True,
    )
    return tomli_w.dumps(tree)


def builtin_names() -> list[str]:
    """Names of the configurations that come with the package."""
    folder = resources.files("pipelines") / "configurations"
    return sorted(
        entry.name.removesuffix(".toml")
        for entry in folder.iterdir()
        if entry.name.endswith(".toml")
    )


def load(source: str | None, overrides: Sequence[str] = ()) -> Configuration:
    """Read and check a configuration.

    Args:
        source: A built-in name, the path of a TOML file, or None for the defaults.
        overrides: ``section.key=value`` with the value in TOML (a bare word is a string).

    Raises:
        ConfigurationError: The file is missing or no TOML, or a setting is unknown or wrong.
    """
    tree = _read(source) if source is not None else {}
    for override in overrides:
        _set(tree, override)
    return parse(tree)


def parse(tree: Mapping[str, Any]) -> Configuration:
    """Check a tree of settings; the first fault is raised as a ConfigurationError."""
    try:
        return Configuration.model_validate(tree)
    except ValidationError as error:
        raise ConfigurationError(_explain(error)) from error


def _read(source: str) -> dict[str, Any]:
    if source in builtin_names():
        text = (resources.files("pipelines") / "configurations" / f"{source}.toml").read_text()
    else:
        path = Path(source)
        if not path.is_file():
            raise ConfigurationError(
                f"configuration {source!r} is neither a file nor built in; give the path of a "
                f"TOML file or one of: {', '.join(builtin_names())}"
            )
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigurationError(
                f"configuration {source!r} cannot be read as UTF-8 text ({error}); "
                "check its permissions and encoding"
            ) from error
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigurationError(
            f"configuration {source!r} is not valid TOML: {error}; mend that line"
        ) from error


def _set(tree: dict[str, Any], override: str) -> None:
    key, equals, text = override.partition("=")
    path = key.strip().split(".")
    if not equals or not all(path):
        raise ConfigurationError(
            f"override {override!r} must look like section.key=value, for example "
            "dataset.solutions=100"
        )
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        value = text.strip()
    node = tree
    for name in path[:-1]:
        node = node.setdefault(name, {})
        if not isinstance(node, dict):
            raise ConfigurationError(
                f"override {override!r}: {name!r} is a single value, not a section; "
                "name one of its own keys or leave the rest of the path out"
            )
    node[path[-1]] = value


def _explain(error: ValidationError) -> str:
    """One line for the first fault of a validation, with the count of the others."""
    faults = error.errors(include_url=False)
    first = faults[0]
    path = ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        rule = f"unknown key {path!r}"
        known = _known_keys(first["loc"][:-1])
        near = difflib.get_close_matches(str(first["loc"][-1]), known, n=1)
        rule += f"; did you mean {near[0]!r}?" if near else f"; known here: {', '.join(known)}"
    else:
        message = first["msg"].removeprefix("Value error, ")
        rule = f"{path}: {message}" if path else message
        if first["type"] != "value_error":
            rule += f", got {first['input']!r}; correct this value"
    others = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
    return f"configuration: {rule}{others}"


def _known_keys(path: tuple[int | str, ...]) -> list[str]:
    model: Any = Configuration
    for part in path:
        field = model.model_fields.get(str(part)) if hasattr(model, "model_fields") else None
        model = field.annotation if field is not None else None
        if model is None:
            return []
    return list(getattr(model, "model_fields", {}))
