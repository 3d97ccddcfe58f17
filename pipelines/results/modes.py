"""The space of modes (Fig. 2): what it stores, and what one task becomes in several modes."""

from dataclasses import dataclass

import numpy as np

from lmtr.arrays import Array, Indices
from lmtr.figures.modes import NEIGHBOURHOOD_COLOURS, Colouring, modes_figure
from lmtr.figures.strategies import Strategies, strategies_figure
from lmtr.models.mode_content import choice_explained, variance_explained
from lmtr.models.trained import TrainedModel
from lmtr.policies.distance import TaskWeights
from lmtr.policies.nearest_neighbour import TaskIndex
from lmtr.trajectory.nodes import HEIGHT, YAW
from lmtr.trajectory.trajectory import Trajectory
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


@dataclass(frozen=True)
class Property:
    """A property of segments.

    Attributes:
        label: Its name with its unit.
        values: (N,); indices of feet if ``is_foot``.
        is_foot: Whether values are feet.
        signed: Whether its sign matters.
    """

    label: str
    values: Array
    is_foot: bool = False
    signed: bool = False

    def explained(self, modes: Array) -> float:
        """How much of it the mode tells, from 0 to 1."""
        if self.is_foot:
            return choice_explained(modes, self.values.astype(np.intp))
        return variance_explained(modes, self.values)


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
    described = properties(decode_segment(tau))
    shown = min(models.values(), key=lambda model: abs(model.latent - 3))
    modes, _ = shown.encode(tau, x)
    rows = _neighbourhoods(x, modes, shown, weights)
    blocks: list[Block] = [
        Illustration(
            "modes",
            modes_figure(
                modes,
                [Colouring(p.label, p.values, p.is_foot, p.signed) for p in described],
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


def properties(segments: Trajectory) -> list[Property]:
    """What Fig. 2 colours modes by.

    Args:
        segments: Batch (N).
    """
    strides = np.linalg.norm(segments.footholds[:, :, -1] - segments.footholds[:, :, 0], axis=-1)
    change = segments.base_nodes[:, -1, 0] - segments.base_nodes[:, 0, 0]
    return [
        Property("stride of LF (m)", strides[:, 0]),
        Property("stride of RF (m)", strides[:, 1]),
        Property("change of yaw (deg)", np.degrees(change[:, YAW]), signed=True),
        Property("change of height (mm)", 1e3 * change[:, HEIGHT], signed=True),
        Property("foot that lifts first", segments.liftoff_times[:, :, 0].argmin(axis=1), True),
    ]


def _content_table(
    models: dict[str, TrainedModel], x: Array, tau: Array, described: list[Property]
) -> Table:
    rows = []
    for model_id, model in models.items():
        modes, _ = model.encode(tau, x)
        rows.append(
            Row(
                [model.settings.name, *(100.0 * p.explained(modes) for p in described)],
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
