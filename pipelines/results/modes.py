"""The space of modes (Fig. 2): what it stores, and what one task becomes in several modes."""

import numpy as np

from lmtr.arrays import Array, Indices
from lmtr.figures.mode_properties import segment_properties
from lmtr.figures.modes import NEIGHBOURHOOD_COLOURS, Colouring, modes_figure
from lmtr.figures.strategies import Strategies, strategies_figure
from lmtr.models.mode_content import choice_explained, variance_explained
from lmtr.models.trained import TrainedModel
from lmtr.policies.distance import TaskWeights
from lmtr.policies.nearest_neighbour import TaskIndex
from lmtr.vectors.layout import TASK_LAYOUT
from lmtr.vectors.segment_vector import decode_segment
from pipelines.learning_data import LearningData
from pipelines.results.blocks import Block, Chapter, Illustration, Row, Table

ALIKE = 16
"""Tasks in a neighbourhood."""

SPREADS = (0.1, 0.5, 0.97)
"""Neighbourhoods are shown at these quantiles of how far apart their modes are."""

CANDIDATES = 400
"""Tasks among which they are looked for."""


def modes_chapter(
    models: dict[str, TrainedModel], data: LearningData, weights: TaskWeights
) -> Chapter:
    """Modes of expert segments as encoders see them.

    Args:
        models: By model id, those with at least two latent dimensions, one of each.
        data: The segments; mirror images are left out.
        weights: w by which tasks are alike.
    """
    own = len(data.training.x) // (2 if data.mirrored else 1)
    x, tau = data.training.x[:own], data.training.tau[:own]
    described = segment_properties(decode_segment(tau))
    shown = min(models.values(), key=lambda model: abs(model.latent - 3))
    modes, _ = shown.encode(tau, x)
    rows = _neighbourhoods(x, modes, shown, weights)
    blocks: list[Block] = [
        Illustration(
            "modes",
            modes_figure(
                modes,
                described,
                neighbourhoods=[modes[near] for near in rows],
            ),
            f"Fig. 2. Modes of the expert's segments as the encoder of {shown.settings.name} sees "
            "them, in its dimensions of largest variance, coloured by properties of their "
            f"segments. (f) Modes of the {ALIKE} nearest tasks of three tasks: one whose "
            "neighbours' modes are close together, a common one, and one whose are far apart.",
        ),
        Illustration(
            "strategies",
            strategies_figure(
                [_strategies(k, x[near[0]], modes[near], shown) for k, near in enumerate(rows)]
            ),
            "What the decoder makes of the first task of each neighbourhood of Fig. 2 f in all of "
            "the neighbourhood's modes, from above.",
        ),
        _content_table(models, x, tau, described),
    ]
    return Chapter("The space of modes", blocks)


def _content_table(
    models: dict[str, TrainedModel], x: Array, tau: Array, described: list[Colouring]
) -> Table:
    rows = []
    for model_id, model in models.items():
        modes, _ = model.encode(tau, x)
        rows.append(
            Row(
                [model.settings.name, *(100.0 * _explained(p, modes) for p in described)],
                [model_id],
            )
        )
    return Table(
        "mode-content",
        "How much of a property the mode tells: share of its variance that the mean over the 15 "
        "nearest other modes explains (of the first foot: share of wrong guesses that their vote "
        "avoids).",
        ["model", *(f"{p.label.split(' (')[0]} (%)" for p in described)],
        rows,
    )


def _explained(described: Colouring, modes: Array) -> float:
    """How much of a property the mode tells, from 0 to 1."""
    if described.is_foot:
        return choice_explained(modes, described.values.astype(np.intp))
    return variance_explained(modes, described.values)


def _neighbourhoods(
    x: Array, modes: Array, model: TrainedModel, weights: TaskWeights
) -> list[Indices]:
    """Rows of three neighbourhoods of tasks, the task itself first."""
    index = TaskIndex(x, weights, model.task_scaling)
    candidates = np.linspace(0, len(x) - 1, min(CANDIDATES, len(x))).round().astype(np.intp)
    count = min(ALIKE, len(x))
    _, rows = index.query(x[candidates], count)
    spread = modes[rows].std(axis=1).mean(axis=-1)
    order = np.argsort(spread, kind="stable")
    return [np.asarray(rows[order[round(q * (len(order) - 1))]], dtype=np.intp) for q in SPREADS]


def _strategies(number: int, task: Array, modes: Array, model: TrainedModel) -> Strategies:
    plans = model.predict(np.repeat(task[None], len(modes), axis=0), modes)
    return Strategies(
        f"({chr(ord('a') + number)}) neighbourhood {number + 1}, {len(modes)} modes",
        TASK_LAYOUT.unpack(task)["next_lines"],
        decode_segment(plans),
        NEIGHBOURHOOD_COLOURS[number],
    )
