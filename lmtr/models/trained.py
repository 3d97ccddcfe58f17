"""A trained model: complete, immutable, and ready to plan without torch."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.models.perceptron import Affine, Perceptron
from lmtr.models.record import EpochRecord
from lmtr.models.rows import finite_rows
from lmtr.models.settings import ModelSettings, TrainingSettings
from lmtr.robot.model import RobotModel
from lmtr.vectors.layout import Layout
from lmtr.vectors.scaling import Standardiser

CHUNK = 4096
"""Rows encoded at once, to bound memory."""


@dataclass(frozen=True, eq=False)
class TrainedModel:
    """Decoder p_ϕ and encoder q_θ (Eq. 4) with everything that their numbers mean.

    Attributes:
        settings: Shape and loss; κ and its reduction hold for the scalings below.
        training: How it was fitted.
        robot: The robot whose expert it imitates.
        task_scaling: Scaling and layout of x.
        segment_scaling: Scaling and layout of τ.
        decoder: (z, x̂) → τ̂ on standardised tasks and segments.
        encoder: (τ, x̂) → (μ, log σ²) on the same; None when n = 0.
        history: Every epoch of its training.
        provenance: Versions of data and code that made it, as plain JSON types.
    """

    settings: ModelSettings
    training: TrainingSettings
    robot: RobotModel
    task_scaling: Standardiser
    segment_scaling: Standardiser
    decoder: Perceptron
    encoder: Perceptron | None
    history: tuple[EpochRecord, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def for_planning(self) -> "TrainedModel":
        """The same model without what planning does not need, the encoder and the history."""
        return replace(self, encoder=None, history=())

    @property
    def latent(self) -> int:
        """n, dimensions of the mode z."""
        return self.settings.latent

    @property
    def task_layout(self) -> Layout:
        """Layout of x."""
        return self.task_scaling.layout

    @property
    def segment_layout(self) -> Layout:
        """Layout of τ."""
        return self.segment_scaling.layout

    @property
    def nbytes(self) -> int:
        """Memory of what planning needs, the decoder (bytes)."""
        return self._planner.nbytes

    @property
    def best_epoch(self) -> EpochRecord | None:
        """The epoch whose weights these are; None without a history."""
        looks = [(e.validation.loss, e.epoch, e) for e in self.history if e.validation is not None]
        return min(looks)[-1] if looks else None

    def describe(self) -> dict[str, Any]:
        """Settings, robot and origin as plain JSON types, for provenance."""
        return {
            "model": self.settings.model_dump(mode="json"),
            "training": self.training.model_dump(mode="json"),
            "robot": self.robot.name,
            "provenance": dict(self.provenance),
        }

    def predict(self, x: Array, z: Array) -> Array:
        """The regressor τ = f_z(x; z) (Sec. 3.2).

        Args:
            x: Tasks (B, 35) in SI units, _S.
            z: Modes (B, n).

        Returns:
            Segments (B, 264) in SI units, _S.

        Raises:
            DataError: Tasks of another layout or not finite, or modes of another shape.
        """
        x = finite_rows("tasks", x, self.task_layout)
        if np.shape(z) != (len(x), self.latent):
            raise DataError(
                f"modes must have shape ({len(x)}, {self.latent}) for {len(x)} tasks and model "
                f"{self.settings.name}, got {np.shape(z)}; use a policy built for this model"
            )
        return self._planner(np.concatenate([z, x], axis=1))

    def encode(self, tau: Array, x: Array) -> tuple[Array, Array]:
        """The modes in which segments solve their tasks (Eq. 4).

        Args:
            tau: Segments (B, 264) in SI units, _S.
            x: Their tasks (B, 35).

        Returns:
            μ_z and σ_z, both (B, n).

        Raises:
            DataError: Either is of another layout or not finite, or their lengths differ.
        """
        tau = finite_rows("segments", tau, self.segment_layout)
        x = finite_rows("tasks", x, self.task_layout)
        if len(tau) != len(x):
            raise DataError(
                f"segments and tasks must be as many, got {len(tau)} and {len(x)}; pair them"
            )
        if self.encoder is None and self.latent:
            raise DataError(
                f"model {self.settings.name} was loaded for planning, without its encoder; load "
                "its own folder to encode segments"
            )
        if self.encoder is None:
            return np.zeros((len(x), 0)), np.zeros((len(x), 0))
        moments = np.empty((len(x), 2 * self.latent))
        for start in range(0, len(x), CHUNK):
            rows = slice(start, start + CHUNK)
            scaled = [self.segment_scaling.apply(tau[rows]), self.task_scaling.apply(x[rows])]
            moments[rows] = self.encoder(np.concatenate(scaled, axis=1))
        mu, log_variance = np.split(moments, 2, axis=1)
        return mu, np.exp(0.5 * log_variance)

    @cached_property
    def _planner(self) -> Perceptron:
        """The decoder from (z, x) to τ, both in SI units."""
        modes, tasks = np.ones(self.latent), standardising(self.task_scaling)
        inputs = Affine(
            scale=np.concatenate([modes, tasks.scale]),
            shift=np.concatenate([np.zeros(self.latent), tasks.shift]),
        )
        outputs = Affine(scale=self.segment_scaling.scale, shift=self.segment_scaling.mean)
        return self.decoder.after(inputs).then(outputs)


def standardising(scaling: Standardiser) -> Affine:
    """The map of ``scaling.apply`` as scale and shift; constant dimensions map to 0."""
    inverse = np.zeros_like(scaling.scale)
    np.divide(1.0, scaling.scale, out=inverse, where=~scaling.constant)
    return Affine(scale=inverse, shift=-scaling.mean * inverse)
