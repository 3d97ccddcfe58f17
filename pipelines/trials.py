"""Which replanners an evaluation compares: models, policies and weights."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from lmtr.models.data import TrainingData
from lmtr.models.trained import TrainedModel
from lmtr.policies.distance import TaskWeights
from lmtr.policies.gaussian_policy import GaussianModePolicy
from lmtr.policies.mode_policy import ModePolicy, PriorModePolicy, ZeroModePolicy
from lmtr.replanners.build import build_replanner
from lmtr.replanners.replanner import Replanner
from lmtr.robot.model import RobotModel
from pipelines.config import fingerprint
from pipelines.learning_data import LearningData
from pipelines.registry import Registered
from pipelines.sections import EvaluationSection, PolicyName
from pipelines.tuning_settings import with_new

CHOICES = {
    "with_library",
    "weights",
    "policies",
    "selection",
    "mode_regressor",
    "tuning",
    "keep_motions",
    "expert_courses",
}
"""Settings of an evaluation that tell its replanners apart, or decide no number; the others are the
testbed."""

Purpose = Literal["report", "tuning"]

EXPERT = "expert"
"""Policy and label of the line of reference: the expert on the reported courses."""

Chosen = Mapping[int | None, Sequence[TaskWeights]]
"""Weights that a search found, by latent dimension; None is the library's."""

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
        latent: Latent dimension of its model; None for the library.
        training_seed: Seed that its model was trained with; None for the library.
        purpose: Whether it is reported, or only chooses weights on other courses.
    """

    evaluation_id: str
    label: str
    model_id: str | None
    weights: TaskWeights
    policy: PolicyName
    latent: int | None = None
    training_seed: int | None = None
    purpose: Purpose = "report"


def trials(
    section: EvaluationSection,
    data: LearningData,
    models: Sequence[Registered],
    chosen: Chosen | None = None,
    purpose: Purpose = "report",
) -> list[Trial]:
    """The replanners that an evaluation asks for with these data and models.

    Args:
        section: What is evaluated, and on which testbed.
        data: What models look up.
        models: The models.
        chosen: Weights besides the section's for policy ``nearest``.
        purpose: What the trials are for.
    """
    candidates: list[Registered | None] = [*models]
    if section.with_library:
        candidates.append(None)
    return [
        trial
        for model in candidates
        for trial in _of_one(model, section, data, chosen or {}, purpose)
    ]


def _of_one(
    model: Registered | None,
    section: EvaluationSection,
    data: LearningData,
    chosen: Chosen,
    purpose: Purpose,
) -> Iterator[Trial]:
    """The trials of one model, or of the library."""
    testbed = section.model_dump(mode="json", exclude=CHOICES)
    name, model_id, latent, seed = (
        (LIBRARY, None, None, None)
        if model is None
        else (model.label, model.model_id, model.latent, model.seed)
    )
    for policy in _policies(latent, section):
        # What looks nothing up does not care for weights.
        looks_up = policy in LOOKS_UP and latent != 0
        choices = list(section.weights if looks_up else section.weights[:1])
        if policy == "nearest" and looks_up:
            choices = with_new(choices, list(chosen.get(latent, ())))
        several = len(choices) > 1 or (looks_up and bool(chosen))
        details = {"selected": section.selection, "gaussian": section.mode_regressor}.get(policy)
        for weights in choices:
            label = _label(name, policy, section)
            if several:
                label += f" w={in_words(weights)}"
            digest = fingerprint(model_id, data.identity, weights, policy, details, testbed)
            slug = name.split(" seed")[0].lower().replace(" ", "-")
            yield Trial(
                f"{slug}-{policy}-{digest}",
                label,
                model_id,
                weights,
                policy,
                latent,
                seed,
                purpose,
            )


def in_words(weights: TaskWeights) -> str:
    """The four weights in the order χ_base, χ_feet, η, γ."""
    return ",".join(f"{value:g}" for value in weights.values)


def _policies(latent: int | None, section: EvaluationSection) -> tuple[PolicyName, ...]:
    if latent == 0:
        return ("nearest",)
    if latent is None:
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
