"""Which replanners an evaluation compares: models, policies and weights."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from lmtr.models.data import TrainingData
from lmtr.models.trained import TrainedModel
from lmtr.policies.distance import TaskWeights
from lmtr.policies.gaussian_policy import GaussianModePolicy
from lmtr.policies.mode_policy import ModePolicy, PriorModePolicy, ZeroModePolicy
from lmtr.replanners.build import build_replanner
from lmtr.replanners.replanner import Replanner
from lmtr.robot.model import RobotModel
from pipelines.config import Configuration, fingerprint
from pipelines.learning_data import LearningData
from pipelines.registry import Registered
from pipelines.sections import EvaluationSection, PolicyName

CHOICES = {"with_library", "weights", "policies", "selection", "mode_regressor"}
"""Settings of an evaluation that tell its replanners apart; the others are the testbed."""

LOOKS_UP: tuple[PolicyName, ...] = ("nearest", "selected")
"""Policies for which the weights of the task distance matter, and that the library has too."""

LIBRARY = "trajectory library"


@dataclass(frozen=True)
class Trial:
    """One replanner to be rolled out.

    Attributes:
        evaluation_id: Its identity: name and a digest of model, data, policy and testbed.
        label: What tables and figures call it.
        model_id: Its model; None for the trajectory library.
        weights: w of its nearest-neighbour look-up.
        policy: How its mode is selected.
    """

    evaluation_id: str
    label: str
    model_id: str | None
    weights: TaskWeights
    policy: PolicyName


def trials(config: Configuration, data: LearningData, models: Sequence[Registered]) -> list[Trial]:
    """The replanners that a configuration asks for with these data and models."""
    candidates: list[tuple[str, str | None]] = [(m.label, m.model_id) for m in models]
    if config.evaluation.with_library:
        candidates.append((LIBRARY, None))
    return [
        trial
        for name, model_id in candidates
        for trial in _of_one(name, model_id, config.evaluation, data)
    ]


def _of_one(
    name: str, model_id: str | None, section: EvaluationSection, data: LearningData
) -> Iterator[Trial]:
    """The trials of one model, or of the library."""
    testbed = section.model_dump(mode="json", exclude=CHOICES)
    for policy in _policies(name, model_id, section):
        # What looks nothing up does not care for weights.
        looks_up = policy in LOOKS_UP and not name.startswith("unimodal")
        choices = section.weights if looks_up else section.weights[:1]
        details = {"selected": section.selection, "gaussian": section.mode_regressor}.get(policy)
        for weights in choices:
            label = _label(name, policy, section)
            if len(choices) > 1:
                label += f" w={','.join(f'{value:g}' for value in weights.values)}"
            digest = fingerprint(model_id, data.identity, weights, policy, details, testbed)
            slug = name.split(" seed")[0].lower().replace(" ", "-")
            yield Trial(f"{slug}-{policy}-{digest}", label, model_id, weights, policy)


def _policies(
    name: str, model_id: str | None, section: EvaluationSection
) -> tuple[PolicyName, ...]:
    if name.startswith("unimodal"):
        return ("nearest",)
    if model_id is None:
        return tuple(policy for policy in section.policies if policy in LOOKS_UP)
    return section.policies


def _label(name: str, policy: PolicyName, section: EvaluationSection) -> str:
    if policy == "nearest":
        return name
    return (
        f"{name} (best of {section.selection.candidates})"
        if policy == "selected"
        else (f"{name} ({policy})")
    )


def replanner_of(
    trial: Trial,
    model: TrainedModel | None,
    library: TrainingData,
    robot: RobotModel,
    section: EvaluationSection,
) -> Replanner:
    """The replanner that a trial is about.

    Args:
        trial: The trial.
        model: Its model; None for the trajectory library.
        library: Expert segments to look up and to fit π_N to.
        robot: Whose range of motion plans shall keep.
        section: Settings of selection, π_N and the prior's draws.
    """
    return build_replanner(
        model,
        library,
        trial.weights,
        policy=None if model is None else _policy(trial.policy, model, library, section),
        selection=section.selection if trial.policy == "selected" else None,
        robot=robot,
    )


def _policy(
    name: PolicyName, model: TrainedModel, library: TrainingData, section: EvaluationSection
) -> ModePolicy | None:
    """A policy that looks nothing up; None for those that do."""
    if name == "gaussian":
        from lmtr.models.mode_regressor import fit_mode_regressor  # torch takes a second to import

        network = fit_mode_regressor(model, library, section.mode_regressor)
        return GaussianModePolicy(network, model.task_scaling)
    if name == "prior":
        return PriorModePolicy(model.latent, section.seed)
    return ZeroModePolicy(model.latent) if name == "zero" else None
