"""The report on training: learning curves, reconstruction, and the space of modes (Fig. 2)."""

from collections.abc import Sequence

from lmtr.figures.learning import learning_figure
from lmtr.figures.mode_properties import segment_properties
from lmtr.figures.modes import modes_figure
from lmtr.models.data import TrainingData
from lmtr.models.trained import TrainedModel
from lmtr.vectors.segment_vector import decode_segment
from pipelines import records
from pipelines.report.page import Cell, Picture, Section, Table


def training_section(
    models: Sequence[tuple[str, TrainedModel]], validation: TrainingData
) -> Section:
    """Learning curves, and what the chosen weights do on segments they have not seen."""
    histories = {label: records.learning_history(model.history) for label, model in models}
    rows: list[list[Cell]] = []
    for label, model in models:
        best = model.best_epoch
        if best is None or best.validation is None:
            continue
        look = best.validation
        rows.append(
            [
                label,
                best.epoch,
                look.reconstruction,
                look.kl,
                look.active_dimensions,
                look.errors.base_position_mm,
                look.errors.times_ms,
                look.errors.second_foothold_mm,
                look.errors.forces_weights,
                look.errors.epoch_feet_mm,
            ]
        )
    return Section(
        "Training",
        [
            Picture(
                "learning",
                learning_figure(histories),
                "Learning curves: thick on validation solutions, thin on training data (with "
                "sampled modes and noisy tasks).",
                "Loss, reconstruction error and KL divergence over epochs for each model.",
            ),
            Table(
                "Reconstruction of validation segments from their own modes, at the epoch chosen.",
                [
                    "model",
                    "epoch",
                    "mean |τ − τ̂| (std.)",
                    "KL (nats)",
                    "active dimensions",
                    "base (mm)",
                    "times (ms)",
                    "next foothold (mm)",
                    "forces (weights)",
                    "feet at the epoch (mm)",
                ],
                rows,
            ),
            *_modes(models, validation),
        ],
    )


def _modes(models: Sequence[tuple[str, TrainedModel]], validation: TrainingData) -> list[Picture]:
    """Modes of held-out segments, coloured by what they stand for (Fig. 2)."""
    label, model = max(models, key=lambda each: each[1].latent)
    if model.latent < 2:
        return []
    mu, _ = model.encode(validation.tau, validation.x)
    return [
        Picture(
            "modes",
            modes_figure(mu, segment_properties(decode_segment(validation.tau))),
            f"Modes z of the validation segments, as the encoder of {label} sees them, in its "
            "dimensions of largest variance.",
            f"Scatter of modes of {label}, coloured by properties of their segments.",
        )
    ]
