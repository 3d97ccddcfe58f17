"""What training gave: reconstruction by category, KL, active dimensions, by n and seed."""

from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np

from lmtr.figures.learning import learning_figure
from lmtr.figures.replanner_styles import replanner_style
from lmtr.figures.style import INK
from lmtr.figures.style import SeriesStyle as Style
from lmtr.figures.sweep import SweepPanel, SweepSeries, sweep_figure
from lmtr.models.trained import TrainedModel
from pipelines import records
from pipelines.results.blocks import Block, Chapter, Illustration, Missing, Row, Table

QUANTITIES = (
    ("base_position_mm", "base", "mm"),
    ("times_ms", "times", "ms"),
    ("second_foothold_mm", "next foothold", "mm"),
    ("forces_weights", "forces", "weights"),
    ("epoch_feet_mm", "feet at the epoch", "mm"),
    ("kl", "KL", "nats"),
    ("active_dimensions", "active dimensions", "–"),
)
"""What the best epoch tells of validation segments: name, name for readers, unit."""


def training_chapter(models: Mapping[str, TrainedModel]) -> Chapter:
    """Learning curves, the table by n and seed, and reconstruction over n.

    Args:
        models: By model id, of the base configuration.
    """
    if not models:
        return Chapter("Training", [Missing("No model has been trained yet; run `lmtr train`.")])
    first = {model.latent: model for _, model in reversed(list(models.items()))}
    names = {model.settings.name: model for _, model in sorted(first.items())}
    blocks: list[Block] = [
        Illustration(
            "learning",
            learning_figure(
                {name: records.learning_history(model.history) for name, model in names.items()},
                {name: replanner_style(model.latent) for name, model in names.items()},
            ),
            "Learning curves of one training seed each: thick on validation solutions, thin on "
            "training data with sampled modes and noisy tasks.",
        ),
        _table(models),
        *_over_latent(list(models.values())),
    ]
    return Chapter("Training", blocks)


def looks(model: TrainedModel) -> dict[str, float]:
    """Validation figures at the epoch whose weights were kept, by the names of QUANTITIES."""
    best = model.best_epoch
    if best is None or best.validation is None:
        return {}
    look = best.validation
    return {
        **look.errors.model_dump(),
        "kl": look.kl,
        "active_dimensions": float(look.active_dimensions),
    }


def _table(models: Mapping[str, TrainedModel]) -> Table:
    rows = []
    for model_id, model in models.items():
        found, best = looks(model), model.best_epoch
        rows.append(
            Row(
                [
                    model.settings.name,
                    str(model.training.seed),
                    len(model.history),
                    None if best is None else best.epoch,
                    None if best is None or best.validation is None else best.validation.loss,
                    *(_cell(name, found.get(name)) for name, _, _ in QUANTITIES),
                ],
                [model_id],
            )
        )
    return Table(
        "training",
        "Validation segments reconstructed from their own modes, at the epoch whose weights were "
        "kept.",
        [
            "model",
            "seed",
            "epochs",
            "kept",
            "loss (–)",
            *(f"{name} ({unit})" for _, name, unit in QUANTITIES),
        ],
        rows,
    )


def _cell(name: str, value: float | None) -> float | int | None:
    """Dimensions are counted, all else is measured."""
    return round(value) if name == "active_dimensions" and value is not None else value


def _over_latent(models: Sequence[TrainedModel]) -> list[Block]:
    latents = sorted({model.latent for model in models})
    if len(latents) < 2:
        return []
    found: dict[str, dict[float, list[float]]] = defaultdict(lambda: defaultdict(list))
    for model in models:
        for name, value in looks(model).items():
            if np.isfinite(value):
                found[name][float(model.latent)].append(value)
    panels = [
        SweepPanel(name[0].upper() + name[1:], f"{name} ({unit})", [SweepSeries("LMTR-n", seeds)])
        for key, name, unit in QUANTITIES
        if (seeds := found.get(key))  # only finite values are in it
    ]
    if not panels:
        return [Missing("No model of this study was validated, so there is no reconstruction.")]
    return [
        Illustration(
            "reconstruction",
            sweep_figure(panels, "latent dimension n", {"LMTR-n": Style(INK, "o", "-")}),
            "Errors of validation segments that are reconstructed from their own modes, "
            "information in the mode and dimensions in use, over n. Dots: training seeds.",
        )
    ]
