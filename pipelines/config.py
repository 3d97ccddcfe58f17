"""The one configuration of a run: a TOML file, checked whole before any work starts.

A configuration names every setting of every stage; what a file leaves out takes the documented
default. Settings classes live beside the code that consumes them, those of the stages themselves
in :mod:`pipelines.sections`.
"""

import difflib
import hashlib
import json
import math
import tomllib
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, get_args

import tomli_w
from pydantic import BaseModel, ValidationError, model_validator

from lmtr import __version__
from lmtr.errors import ConfigurationError
from lmtr.expert.settings import ExpertSettings
from lmtr.expert.suitability import require_suitable
from lmtr.quality.filter import QualityThresholds
from lmtr.segmentation.segment import SegmentationSettings
from lmtr.settings import Settings
from lmtr.task.sampling import TaskDistribution
from lmtr.task.task import foot_excess, reach
from pipelines.sections import (
    ClusterSection,
    DatasetSection,
    EvaluationSection,
    TrainingSection,
)


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
    def _expert_suits_robot(self) -> "Configuration":
        try:
            require_suitable(self.dataset.robot, self.expert)
        except ConfigurationError as error:
            raise ValueError(str(error)) from error
        return self

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
        margin = self.expert.range_of_motion_margin
        if foot_excess(tasks.foot_scatter, robot, margin) > 0.0:
            raise ValueError(
                f"tasks.foot_scatter must stay within the range of motion "
                f"±{robot.range_of_motion[:2]} m of robot {robot.name!r} less the margin of "
                f"{margin} m (expert.range_of_motion_margin), got {tasks.foot_scatter} m; scatter "
                "the start feet less"
            )
        return self

    @model_validator(mode="after")
    def _tuned_models_are_trained(self) -> "Configuration":
        tuning = self.evaluation.tuning
        # Evaluating what was trained before needs no word on training.
        if (
            tuning is None
            or tuning.latent is None
            or "latent" not in self.training.model_fields_set
        ):
            return self
        unknown = [latent for latent in tuning.latent if latent not in self.training.latent]
        if unknown:
            raise ValueError(
                f"evaluation.tuning.latent names {unknown}, but training.latent is "
                f"{list(self.training.latent)}; train those too or leave them out"
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


def settings_digest(config: Configuration) -> str:
    """Of all settings but the cluster's, which decide no number."""
    return fingerprint(config.model_dump(mode="json", exclude={"cluster"}))


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
    """Read and check a configuration; its variants (:mod:`pipelines.study`) are not looked at.

    Args:
        source: A built-in name, the path of a TOML file, or None for the defaults.
        overrides: ``section.key=value`` with the value in TOML (a bare word is a string).

    Raises:
        ConfigurationError: The file is missing or no TOML, or a setting is unknown or wrong.
    """
    tree = settings_tree(source, overrides)
    tree.pop("variants", None)
    return parse(tree)


def settings_tree(source: str | None, overrides: Sequence[str] = ()) -> dict[str, Any]:
    """What a file and the overrides set, unchecked, with the variants if the file has some.

    Raises:
        ConfigurationError: The file is missing or no TOML, or an override is no assignment.
    """
    tree = _read(source) if source is not None else {}
    for override in overrides:
        _set(tree, override)
    return tree


def parse(tree: Mapping[str, Any]) -> Configuration:
    """Check a tree of settings; the first fault is raised as a ConfigurationError."""
    try:
        return Configuration.model_validate(tree)
    except ValidationError as error:
        raise ConfigurationError(_explain(error)) from error


def source_text(source: str) -> str:
    """The text of a configuration.

    Args:
        source: A built-in name or the path of a file.

    Raises:
        ConfigurationError: The file is missing or no text.
    """
    if source in builtin_names():
        return (resources.files("pipelines") / "configurations" / f"{source}.toml").read_text()
    path = Path(source)
    if not path.is_file():
        raise ConfigurationError(
            f"configuration {source!r} is neither a file nor built in; give the path of a "
            f"TOML file or one of: {', '.join(builtin_names())}"
        )
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigurationError(
            f"configuration {source!r} cannot be read as UTF-8 text ({error}); "
            "check its permissions and encoding"
        ) from error


def _read(source: str) -> dict[str, Any]:
    text = source_text(source)
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
    if path[:2] == ["dataset", "robot"] and len(path) > 2:
        _spell_out_robot(tree)
    node = tree
    for name in path[:-1]:
        node = node.setdefault(name, {})
        if not isinstance(node, dict):
            raise ConfigurationError(
                f"override {override!r}: {name!r} is a single value, not a section; "
                "name one of its own keys or leave the rest of the path out"
            )
    node[path[-1]] = value


def _spell_out_robot(tree: dict[str, Any]) -> None:
    """Put the figures of a robot in the place of its name, or of none, so that each can be set."""
    dataset = tree.setdefault("dataset", {})
    if not isinstance(dataset, dict) or isinstance(dataset.get("robot"), dict):
        return
    try:
        section = DatasetSection.model_validate({k: v for k, v in dataset.items() if k == "robot"})
    except ValidationError as error:
        raise ConfigurationError(_explain(error)) from error
    dataset["robot"] = section.robot.model_dump(mode="json")


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
        model = _section(field.annotation) if field is not None else None
        if model is None:
            return []
    return list(getattr(model, "model_fields", {}))


def _section(annotation: Any) -> Any:  # noqa: ANN401 - whatever a field is annotated with
    """The settings behind an annotation that may also allow None."""
    allowed = (annotation, *get_args(annotation))
    return next((each for each in allowed if hasattr(each, "model_fields")), annotation)
