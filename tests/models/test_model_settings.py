"""Settings of model and training: defaults of the paper, contradictions refused."""

import pytest
from pydantic import ValidationError

from lmtr.models.settings import ModelSettings, TrainingSettings


def test_defaults_are_the_papers():
    settings = ModelSettings()
    assert settings.hidden == (64, 64, 264, 264)
    assert settings.kappa == 0.001
    assert settings.task_noise == 0.01


def test_names_are_the_papers():
    assert ModelSettings(latent=12).name == "LMTR-12"
    assert ModelSettings(latent=0).name == "unimodal"


def test_a_latent_space_wider_than_a_layer_is_refused_with_both_numbers():
    with pytest.raises(ValidationError, match=r"latent = 17 .*\(16, 32\).* at most 16"):
        ModelSettings(latent=17, hidden=(16, 32))


def test_no_hidden_layer_is_refused():
    with pytest.raises(ValidationError, match="at least one layer"):
        ModelSettings(hidden=())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"epochs": 3, "validate_every": 4}, "validate_every = 4 exceeds epochs = 3"),
        ({"patience": 2, "validate_every": 5}, "patience = 2 .* validate_every = 5"),
        ({"learning_rate": float("nan")}, "learning_rate"),
        ({"device": "tpu"}, "device"),
    ],
)
def test_contradicting_training_settings_are_refused_with_their_values(change, message):
    with pytest.raises(ValidationError, match=message):
        TrainingSettings(**change)
