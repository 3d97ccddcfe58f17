"""Which replanners an evaluation compares, and that each is the one that its trial names."""

import numpy as np
import pytest

from lmtr.errors import ConfigurationError
from lmtr.models.settings import ModelSettings, TrainingSettings
from lmtr.models.training import train
from lmtr.robot.model import ANYMAL
from pipelines.config import load
from pipelines.learning_data import LearningData
from pipelines.registry import Registered
from pipelines.trials import replanner_of, trials

SETTINGS = (
    'evaluation.policies=["nearest", "selected", "gaussian", "prior", "zero"]',
    "evaluation.weights=[{eta = 5.0}, {gamma = 0.5}]",
    "evaluation.selection.candidates=3",
    "evaluation.mode_regressor.epochs=2",
)

KNOWN = [Registered("m0", "unimodal", 0, 0), Registered("m3", "LMTR-3", 3, 0)]


@pytest.fixture(scope="module")
def data(walk_segments):
    return LearningData("walks", "cut", 0, walk_segments, walk_segments)


def asked_for(data, *changes):
    return trials(load(None, [*SETTINGS, *changes]).evaluation, data, KNOWN)


def test_weights_multiply_what_looks_tasks_up(data):
    labels = [trial.label for trial in asked_for(data)]
    assert labels == [
        "unimodal",
        "LMTR-3 w=1,1,5,1",
        "LMTR-3 w=1,1,1,0.5",
        "LMTR-3 (best of 3) w=1,1,5,1",
        "LMTR-3 (best of 3) w=1,1,1,0.5",
        "LMTR-3 (gaussian)",
        "LMTR-3 (prior)",
        "LMTR-3 (zero)",
        "trajectory library w=1,1,5,1",
        "trajectory library w=1,1,1,0.5",
        "trajectory library (best of 3) w=1,1,5,1",
        "trajectory library (best of 3) w=1,1,1,0.5",
    ]


def test_four_numbers_are_the_same_weights(data):
    short = asked_for(data, "evaluation.weights=[[1.0, 1.0, 5.0, 1.0], {gamma = 0.5}]")
    assert short == asked_for(data)


def test_identities_follow_what_a_replanner_depends_on(data):
    def changed(*changes):
        before, after = asked_for(data), asked_for(data, *changes)
        return {
            one.policy
            for one, other in zip(before, after, strict=True)
            if one.evaluation_id != other.evaluation_id
        }

    assert changed("evaluation.selection.cost.jump=0.7") == {"selected"}
    assert changed("evaluation.mode_regressor.seed=3") == {"gaussian"}
    everyone = {"nearest", "selected", "gaussian", "prior", "zero"}
    assert changed("evaluation.seed=5") == everyone
    assert len({trial.evaluation_id for trial in asked_for(data)}) == 12


def test_each_trial_plans_in_its_own_way(data, walk_segments):
    brief = TrainingSettings(epochs=30, batch_size=40, validate_every=10, device="cpu")
    models = {
        f"m{n}": train(
            ModelSettings(latent=n, hidden=(16, 24)), brief, walk_segments, walk_segments, ANYMAL
        )
        for n in (0, 3)
    }
    section = load(None, list(SETTINGS)).evaluation
    plans = {}
    for trial in asked_for(data):
        model = None if trial.model_id is None else models[trial.model_id]
        replanner = replanner_of(trial, model, walk_segments, ANYMAL, section)
        # The library's name in tables is longer than in code.
        assert trial.label.replace("trajectory ", "").startswith(replanner.name)
        plans[trial.label] = replanner.plan(walk_segments.x + 0.01)
    different = {plan.tobytes() for plan in plans.values()}
    assert len(different) >= 10  # weights may agree about the nearest
    assert all(np.isfinite(plan).all() for plan in plans.values())


def test_a_policy_twice_is_refused():
    with pytest.raises(ConfigurationError, match="name each one once"):
        load(None, ['evaluation.policies=["zero", "zero"]'])
