"""Fitting the CVAE to expert segments (Sec. 3.2, 4.3).

The result is a function of data, settings and seed; on one device and number of threads it is
the same to the last bit. A training that is interrupted, by the user or by an error raised from
``report``, leaves nothing behind: a :class:`TrainedModel` is complete or not there.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import torch
from torch import Generator, Tensor

from lmtr.errors import ConfigurationError, ModelError
from lmtr.models.cvae import CVAE, normal_like
from lmtr.models.data import TrainingData
from lmtr.models.epoch_feet import EpochFeet
from lmtr.models.latent import active_dimensions
from lmtr.models.loss import Loss, cvae_loss
from lmtr.models.networks import as_perceptron, torch_threads
from lmtr.models.perceptron import Perceptron
from lmtr.models.reconstruction import reconstruction_errors
from lmtr.models.record import EpochRecord, ValidationRecord
from lmtr.models.settings import ModelSettings, TrainingSettings
from lmtr.models.trained import TrainedModel
from lmtr.robot.model import RobotModel
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT
from lmtr.vectors.scaling import Standardiser

WARM_UP = 0.3
"""Share of the steps in which the one-cycle schedule rises to its peak."""

WARM_UP_START = 0.04
"""Where it rises from, as a share of the peak."""


def train(
    model_settings: ModelSettings,
    training_settings: TrainingSettings,
    training: TrainingData,
    validation: TrainingData,
    robot: RobotModel,
    *,
    provenance: Mapping[str, Any] | None = None,
    report: Callable[[EpochRecord], None] | None = None,
) -> TrainedModel:
    """Fit a CVAE with Adam on Eq. 5 and keep the weights that do best on the validation data.

    Args:
        model_settings: Shape and loss.
        training_settings: Epochs, schedule, seed, device.
        training: Data to fit; scalings are fitted to them too.
        validation: Data of other solutions, to choose the epoch by.
        robot: Whose motions these are.
        provenance: Versions of data and code, stored with the model.
        report: Called after every epoch; what it raises ends the training.

    Raises:
        DataError: Data that do not fit the layouts, are empty or not finite.
        ConfigurationError: A GPU is asked for and there is none.
        ModelError: The loss became infinite or NaN.
    """
    training = training.checked("training")
    validation = validation.checked("validation")
    task_scaling = Standardiser.fit(TASK_LAYOUT, training.x)
    segment_scaling = Standardiser.fit(SEGMENT_LAYOUT, training.tau)
    with torch_threads(training_settings.threads):
        device = _device(training_settings)
        weights = _weights(model_settings, segment_scaling, robot, device)
        fit = _Fit(
            model_settings,
            training_settings,
            _Batch.of(training, task_scaling, segment_scaling, device),
            weights,
            EpochFeet(segment_scaling, device),
        )
        judge = _Judge(
            _Batch.of(validation, task_scaling, segment_scaling, device),
            validation,
            segment_scaling,
            robot,
            training_settings.seed,
        )
        best, history = _best_epoch(fit, judge, training_settings, report)
    return TrainedModel(
        settings=model_settings,
        training=training_settings,
        robot=robot,
        task_scaling=task_scaling,
        segment_scaling=segment_scaling,
        decoder=best.decoder,
        encoder=best.encoder,
        history=history,
        provenance=dict(provenance or {}),
    )


def _best_epoch(
    fit: "_Fit",
    judge: "_Judge",
    settings: TrainingSettings,
    report: Callable[[EpochRecord], None] | None,
) -> tuple["_Candidate", tuple[EpochRecord, ...]]:
    """Run the epochs; the weights with the least validation loss, and the history."""
    history: list[EpochRecord] = []
    best: _Candidate | None = None
    for epoch in range(1, settings.epochs + 1):
        record = fit.epoch(epoch)
        if epoch % settings.validate_every == 0 or epoch == settings.epochs:
            look = judge.look_at(fit)
            record = record.model_copy(update={"validation": look})
            if best is None or look.loss < best.loss:
                best = _Candidate.of(epoch, look.loss, fit.cvae, fit.settings)
        history.append(record)
        if report is not None:
            report(record)
        if best is not None and _is_overdue(epoch - best.epoch, settings):
            break
    assert best is not None  # the settings see to it that validation comes at least once
    return best, tuple(history)


def schedule_factor(settings: TrainingSettings, progress: float) -> float:
    """The learning rate over its peak, when ``progress`` ∈ [0, 1] of all steps are done."""
    if settings.schedule == "one_cycle":
        if progress < WARM_UP:
            rise = 0.5 * (1.0 - math.cos(math.pi * progress / WARM_UP))
            return WARM_UP_START + (1.0 - WARM_UP_START) * rise
        progress = (progress - WARM_UP) / (1.0 - WARM_UP)
    return 0.5 * (1.0 + math.cos(math.pi * progress))


@dataclass(frozen=True)
class _Batch:
    """Standardised tasks (B, 35) and segments (B, 264) on the training's device."""

    x: Tensor
    tau: Tensor

    @classmethod
    def of(
        cls, data: TrainingData, tasks: Standardiser, segments: Standardiser, device: torch.device
    ) -> "_Batch":
        return cls(
            torch.as_tensor(tasks.apply(data.x), dtype=torch.float32, device=device),
            torch.as_tensor(segments.apply(data.tau), dtype=torch.float32, device=device),
        )

    def __len__(self) -> int:
        return len(self.x)

    def __getitem__(self, rows: Tensor) -> "_Batch":
        return _Batch(self.x[rows], self.tau[rows])


@dataclass(frozen=True)
class _Candidate:
    """The weights of one epoch and what the validation data say of them."""

    epoch: int
    loss: float
    decoder: Perceptron
    encoder: Perceptron | None

    @classmethod
    def of(cls, epoch: int, loss: float, cvae: CVAE, settings: ModelSettings) -> "_Candidate":
        encoder = None if cvae.encoder is None else as_perceptron(cvae.encoder, settings.activation)
        return cls(epoch, loss, as_perceptron(cvae.decoder, settings.activation), encoder)


class _Fit:
    """The CVAE in training: weights, optimiser, schedule and sources of noise."""

    def __init__(
        self,
        settings: ModelSettings,
        training: TrainingSettings,
        data: _Batch,
        weights: Tensor,
        feet: EpochFeet,
    ) -> None:
        self.settings, self._training, self._data = settings, training, data
        self._weights, self._feet = weights, feet
        device = data.x.device
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(training.seed)
            self.cvae = CVAE(data.x.shape[1], data.tau.shape[1], settings).to(device)
        self._order = Generator().manual_seed(training.seed)
        self._noise = Generator(device).manual_seed(training.seed)
        self._optimiser = torch.optim.Adam(
            self.cvae.parameters(), lr=training.learning_rate, fused=True
        )
        steps = training.epochs * math.ceil(len(data) / training.batch_size)
        self._schedule = torch.optim.lr_scheduler.LambdaLR(
            self._optimiser, lambda step: schedule_factor(training, min(step / steps, 1.0))
        )

    def epoch(self, epoch: int) -> EpochRecord:
        """One pass over the data in random order.

        Raises:
            ModelError: The loss is no longer finite.
        """
        sums = torch.zeros(3, device=self._data.x.device)
        order = torch.randperm(len(self._data), generator=self._order)
        for rows in torch.split(order, self._training.batch_size):
            loss = self._step(self._data[rows.to(self._data.x.device)])
            parts = torch.stack([loss.total, loss.reconstruction, loss.kl])
            sums += len(rows) * parts.detach()
        total, reconstruction, kl = (sums / len(self._data)).tolist()
        _require_finite(total, f"training loss of {self.settings.name} in epoch {epoch}")
        return EpochRecord(
            epoch=epoch,
            learning_rate=float(self._schedule.get_last_lr()[0]),
            loss=total,
            reconstruction=reconstruction,
            kl=kl,
        )

    def _step(self, batch: _Batch) -> Loss:
        x = batch.x + self.settings.task_noise * normal_like(batch.x, self._noise)  # (B, 35)
        loss = self.loss(_Batch(x, batch.tau), self._noise)
        self._optimiser.zero_grad(set_to_none=True)
        loss.total.backward()  # type: ignore[no-untyped-call]
        self._optimiser.step()
        self._schedule.step()
        return loss

    def loss(self, batch: _Batch, noise: Generator) -> Loss:
        """Eq. 5 of a batch with the present weights, and how far its feet start from the truth."""
        out = self.cvae(batch.tau, batch.x, noise)
        loss = cvae_loss(
            batch.tau,
            out.tau_hat,
            out.mu,
            out.log_variance,
            self.settings.kappa,
            self.settings.reduction,
            self._weights,
        )
        start = self.settings.loss_weights.start
        if start == 0.0:
            return loss
        if self.settings.reduction == "sum":
            start *= batch.tau.shape[1]  # against a sum it counts like against the mean
        return loss.plus(start, self._feet.error(batch.tau, out.tau_hat))


@dataclass(frozen=True)
class _Judge:
    """The validation data, scaled and in SI units."""

    scaled: _Batch
    data: TrainingData
    segment_scaling: Standardiser
    robot: RobotModel
    seed: int

    @torch.no_grad()
    def look_at(self, fit: _Fit) -> ValidationRecord:
        """Loss, use of the latent space and physical errors of the present weights.

        Raises:
            ModelError: The loss is no longer finite.
        """
        cvae, x, tau = fit.cvae, self.scaled.x, self.scaled.tau
        noise = Generator(x.device).manual_seed(self.seed)
        loss = fit.loss(self.scaled, noise)
        _require_finite(float(loss.total), f"validation loss of {fit.settings.name}")
        mu, _ = cvae.encode(tau, x)
        tau_hat = self.segment_scaling.invert(cvae.decode(mu, x).double().cpu().numpy())
        return ValidationRecord(
            loss=float(loss.total),
            reconstruction=float(loss.reconstruction),
            kl=float(loss.kl),
            active_dimensions=int(active_dimensions(mu.double().cpu().numpy()).sum()),
            errors=reconstruction_errors(self.data.tau, tau_hat, self.robot.weight),
        )


def _weights(
    settings: ModelSettings, scaling: Standardiser, robot: RobotModel, device: torch.device
) -> Tensor:
    """How much each dimension's error counts, (264,)."""
    weights = settings.loss_weights.of(scaling, robot.weight)
    return torch.as_tensor(weights, dtype=torch.float32, device=device)


def _require_finite(loss: float, what: str) -> None:
    if not math.isfinite(loss):
        raise ModelError(f"{what}: must stay finite, got {loss}; lower learning_rate")


def _is_overdue(epochs_without_better: int, settings: TrainingSettings) -> bool:
    return settings.patience is not None and epochs_without_better >= settings.patience


def _device(settings: TrainingSettings) -> torch.device:
    if settings.device == "cuda" and not torch.cuda.is_available():
        raise ConfigurationError(
            "training: device 'cuda' is asked for and torch finds no GPU; use 'auto' or 'cpu'"
        )
    use_gpu = settings.device != "cpu" and torch.cuda.is_available()
    return torch.device("cuda" if use_gpu else "cpu")
