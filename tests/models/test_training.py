"""Training: it learns, separates modes, repeats itself, and refuses what it cannot use."""

import dataclasses

import numpy as np
import pytest
import torch

from lmtr.errors import ConfigurationError, DataError, ModelError
from lmtr.models.data import TrainingData
from lmtr.models.settings import ModelSettings, TrainingSettings
from lmtr.models.training import schedule_factor, train
from lmtr.robot.model import ANYMAL

SMALL = ModelSettings(latent=2, hidden=(16, 24))
BRIEF = TrainingSettings(epochs=4, batch_size=32, validate_every=2, patience=None, device="cpu")


def test_a_small_data_set_is_learnt_by_heart(walk_segments):
    few = TrainingData(walk_segments.x[:50], walk_segments.tau[:50])
    model = train(
        ModelSettings(latent=6, task_noise=0.0, kappa=1e-5),
        TrainingSettings(
            epochs=400, batch_size=50, validate_every=100, patience=None, device="cpu"
        ),
        few,
        few,
        ANYMAL,
    )
    look = model.best_epoch.validation
    assert model.history[0].reconstruction > 0.5
    assert look.reconstruction < 0.05
    assert look.errors.second_foothold_mm < 10.0


def test_modes_that_a_regressor_blurs_are_told_apart_by_a_latent_space(fork):
    seen, unseen = fork(600, 0), fork(100, 1)
    settings = TrainingSettings(
        epochs=80, batch_size=200, validate_every=20, patience=None, device="cpu"
    )
    blurred, clear = (
        train(ModelSettings(latent=n, hidden=(32, 64)), settings, seen.data, unseen.data, ANYMAL)
        for n in (0, 2)
    )

    def misses(model, solution):
        mu, _ = model.encode(solution, unseen.x)
        error = model.predict(unseen.x, mu) - solution
        return np.abs(error[:, unseen.differs]).mean(axis=1)

    # One answer per task cannot be nearer than half the gap to both of its solutions.
    worse = np.maximum(misses(blurred, unseen.left), misses(blurred, unseen.right))
    assert worse.min() >= 0.5 * unseen.gap - 1e-9
    assert misses(clear, unseen.left).mean() < 0.15 * unseen.gap
    assert misses(clear, unseen.right).mean() < 0.15 * unseen.gap
    look = clear.best_epoch.validation
    assert look.kl > np.log(2.0) - 0.1  # the mode carries which of the two it is: one bit
    assert look.active_dimensions >= 1
    assert blurred.best_epoch.validation.kl == 0.0


def test_a_heavy_divergence_switches_the_latent_space_off(fork):
    seen = fork(200, 0)
    model = train(
        ModelSettings(latent=2, hidden=(16, 24), kappa=10.0),
        TrainingSettings(epochs=30, batch_size=100, patience=None, device="cpu"),
        seen.data,
        seen.data,
        ANYMAL,
    )
    assert model.best_epoch.validation.active_dimensions == 0


def test_the_seed_decides_everything(walk_segments):
    def fitted(seed):
        return train(
            SMALL,
            BRIEF.model_copy(update={"seed": seed}),
            walk_segments,
            walk_segments,
            ANYMAL,
        )

    one, again, other = fitted(0), fitted(0), fitted(1)
    assert one.history == again.history
    for a, b in zip(one.decoder.weights, again.decoder.weights, strict=True):
        np.testing.assert_array_equal(a, b)
    assert not np.array_equal(one.decoder.weights[0], other.decoder.weights[0])


def test_training_leaves_the_callers_random_numbers_and_threads_alone(walk_segments):
    torch.manual_seed(7)
    expected = torch.rand(3)
    threads = torch.get_num_threads()
    torch.manual_seed(7)
    train(SMALL, BRIEF, walk_segments, walk_segments, ANYMAL)
    assert torch.equal(torch.rand(3), expected)
    assert torch.get_num_threads() == threads


def test_the_weights_kept_are_those_of_the_best_look(walk_segments, fork):
    other = fork(40, 3).data  # nothing to do with the walks: it soon gets worse on them
    model = train(
        SMALL,
        TrainingSettings(
            epochs=40,
            batch_size=32,
            learning_rate=0.02,
            schedule="cosine",
            validate_every=1,
            patience=5,
            device="cpu",
        ),
        walk_segments,
        other,
        ANYMAL,
    )
    losses = [record.validation.loss for record in model.history]
    best = int(np.argmin(losses))
    assert len(losses) == best + 1 + 5  # patience
    again = train(
        SMALL,
        model.training.model_copy(update={"patience": None}),
        walk_segments,
        other,
        ANYMAL,
    )
    assert model.best_epoch.epoch == best + 1
    mu, _ = model.encode(other.tau, other.x)
    np.testing.assert_array_equal(again.encode(other.tau, other.x)[0], mu)


def test_noise_on_task_inputs_hides_what_it_drowns(fork):
    data = fork(200, 0).data

    def error(noise):
        settings = ModelSettings(latent=0, hidden=(16, 24), task_noise=noise)
        clear = TrainingSettings(epochs=30, batch_size=100, patience=None, device="cpu")
        return train(settings, clear, data, data, ANYMAL).history[-1].reconstruction

    assert error(10.0) > 1.1 * error(0.0)


def test_reports_are_the_history_and_may_end_the_training(walk_segments):
    seen = []
    model = train(SMALL, BRIEF, walk_segments, walk_segments, ANYMAL, report=seen.append)
    assert tuple(seen) == model.history
    assert [record.validation is not None for record in seen] == [False, True, False, True]

    def stop(record):
        raise KeyboardInterrupt

    threads = torch.get_num_threads()
    with pytest.raises(KeyboardInterrupt):
        train(SMALL, BRIEF, walk_segments, walk_segments, ANYMAL, report=stop)
    assert torch.get_num_threads() == threads


@pytest.mark.parametrize(
    ("field", "culprit"), [("x", "goal_position"), ("tau", "RF_second_foothold")]
)
def test_data_that_are_not_finite_are_refused_by_field(walk_segments, field, culprit, small_model):
    layout = getattr(small_model(0), "task_layout" if field == "x" else "segment_layout")
    rows = getattr(walk_segments, field).copy()
    rows[3, layout.slice(culprit)] = np.nan
    broken = dataclasses.replace(walk_segments, **{field: rows})
    with pytest.raises(DataError, match=f"training .*{culprit}"):
        train(SMALL, BRIEF, broken, walk_segments, ANYMAL)
    with pytest.raises(DataError, match=f"validation .*{culprit}"):
        train(SMALL, BRIEF, walk_segments, broken, ANYMAL)


def test_data_that_no_training_can_use_are_refused(walk_segments):
    x, tau = walk_segments.x, walk_segments.tau
    with pytest.raises(DataError, match="validation data: at least one row"):
        train(SMALL, BRIEF, walk_segments, TrainingData(x[:0], tau[:0]), ANYMAL)
    with pytest.raises(DataError, match="got 5 and 6"):
        train(SMALL, BRIEF, TrainingData(x[:5], tau[:6]), walk_segments, ANYMAL)
    with pytest.raises(DataError, match=r"training tasks x: .* last axis of 35"):
        train(SMALL, BRIEF, TrainingData(x[:, 1:], tau), walk_segments, ANYMAL)


def test_a_diverging_training_is_an_error_of_the_model(walk_segments):
    reckless = BRIEF.model_copy(update={"learning_rate": 1e12, "epochs": 8})
    with pytest.raises(ModelError, match="learning_rate"):
        train(SMALL, reckless, walk_segments, walk_segments, ANYMAL)


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU")
def test_a_missing_gpu_is_named(walk_segments):
    on_gpu = BRIEF.model_copy(update={"device": "cuda"})
    with pytest.raises(ConfigurationError, match="'cuda'"):
        train(SMALL, on_gpu, walk_segments, walk_segments, ANYMAL)


@pytest.mark.parametrize("schedule", ["one_cycle", "cosine"])
def test_schedules_peak_at_one_and_end_at_zero(schedule):
    settings = TrainingSettings(schedule=schedule)
    factors = np.array([schedule_factor(settings, p) for p in np.linspace(0.0, 1.0, 101)])
    peak = int(factors.argmax())
    assert factors[peak] == pytest.approx(1.0)
    assert peak == {"one_cycle": 30, "cosine": 0}[schedule]
    assert (np.diff(factors[: peak + 1]) > 0.0).all()
    assert (np.diff(factors[peak:]) < 0.0).all()
    assert factors[-1] == pytest.approx(0.0)
