"""Learning curves of models (Sec. 4.3): loss and its parts over epochs."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, StrMethodFormatter

from lmtr.errors import DataError
from lmtr.figures.style import FULL_WIDTH, INK, SeriesStyle, Styles, styled, styles_for

Record = Mapping[str, float]
History = Sequence[Record]
"""One record per epoch: ``epoch`` and, by name, losses of the training and validation data."""

PANELS = (
    ("loss", "loss (–)", "Loss"),
    ("reconstruction", "mean |τ − τ̂|, standardised (–)", "Reconstruction"),
    ("kl", "KL divergence (nats)", "Information in the mode"),
)
"""Quantity, axis label and title of each panel; a panel without data is left out."""

PARTS = {"train": (0.9, 0.55), "validation": (2.0, 1.0)}
"""Line width and opacity of the two parts of the data."""


@styled
def learning_figure(histories: Mapping[str, History], styles: Styles | None = None) -> Figure:
    """Loss, reconstruction error and KL divergence over epochs, one colour per model.

    Solid thick lines are validation data, thin ones training data.

    Args:
        histories: By model, records with ``epoch`` and any of ``train_loss``,
            ``validation_loss``, ``train_reconstruction``, …, ``validation_kl``.
        styles: Styles of the models, if other figures show them too.

    Raises:
        DataError: No model has a record, or no record has a known quantity.
    """
    histories = {name: history for name, history in histories.items() if len(history)}
    panels = [panel for panel in PANELS if _has(histories, panel[0])]
    if not panels:
        raise DataError(
            "learning figure: needs records with train_ or validation_ loss, reconstruction or kl, "
            f"got models {list(histories)}; train a model first"
        )
    styles = styles_for(histories, styles)
    figure = Figure(figsize=(FULL_WIDTH, 3.6), layout="constrained")
    for axes, (quantity, label, title) in zip(
        figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True
    ):
        for name, history in histories.items():
            _draw(axes, history, quantity, name, styles[name])
        axes.set_xlabel("epoch")
        axes.set_ylabel(label)
        axes.set_title(title)
        if quantity != "kl":
            axes.set_yscale("log")
            axes.yaxis.set_minor_locator(LogLocator(subs=(2.0, 3.0, 5.0)))
            axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
            axes.yaxis.set_minor_formatter(StrMethodFormatter("{x:g}"))
        else:
            axes.set_ylim(bottom=0.0)
    return _with_legend(figure)


def _has(histories: Mapping[str, History], quantity: str) -> bool:
    return any(
        f"{part}_{quantity}" in record
        for history in histories.values()
        for record in history
        for part in ("train", "validation")
    )


def _draw(axes: Axes, history: History, quantity: str, name: str, style: SeriesStyle) -> None:
    for part, (width, alpha) in PARTS.items():
        column = f"{part}_{quantity}"
        points = np.array([(r["epoch"], r[column]) for r in history if column in r], dtype=float)
        if not len(points):
            continue
        axes.plot(
            points[:, 0],
            points[:, 1],
            color=style.colour,
            linestyle=style.line,
            linewidth=width,
            marker="." if len(points) == 1 else "",
            alpha=alpha,
            label=f"{name}, {part}",
        )


def _with_legend(figure: Figure) -> Figure:
    """One legend under all panels: each model once, and what thick and thin lines are."""
    entries: dict[str, Line2D] = {}
    for axes in figure.axes:
        for line in axes.lines:
            name = str(line.get_label()).rsplit(", ", 1)[0]
            entries.setdefault(name, Line2D([], [], color=line.get_color(), linewidth=2.0))
            entries[name].set_linestyle(line.get_linestyle())
    for part, (width, alpha) in PARTS.items():
        entries[part] = Line2D([], [], color=INK, linewidth=width, alpha=alpha)
    figure.legend(
        list(entries.values()),
        list(entries),
        loc="outside lower center",
        ncols=min(6, len(entries)),
    )
    return figure
