"""Labels written beside what they name, kept from covering each other."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from lmtr.arrays import Array

LINE_HEIGHT = 1.25
"""Distance of two lines of text, in font sizes."""


@dataclass(frozen=True)
class EndLabel:
    """A label at the end of a curve.

    Attributes:
        text: What it says.
        x: Where its curve ends, in the data's units.
        y: Likewise.
        colour: That of its curve.
    """

    text: str
    x: float
    y: float
    colour: str


def spread(places: Sequence[float], gap: float) -> Array:
    """Places, moved as little as possible so that neighbours in order are ``gap`` apart.

    The least-squares solution: after the gaps are taken off, neighbours that would overlap share
    their mean (pooling of adjacent violators).
    """
    order = np.argsort(places, kind="stable")
    rest = np.asarray(places, dtype=float)[order] - gap * np.arange(len(order))
    blocks: list[tuple[float, int]] = []
    for value in rest.tolist():
        mean, count = value, 1
        while blocks and blocks[-1][0] > mean:
            before, size = blocks.pop()
            mean, count = (before * size + mean * count) / (size + count), size + count
        blocks.append((mean, count))
    moved = np.concatenate([np.full(count, mean) for mean, count in blocks]) if blocks else rest
    result = np.empty(len(order))
    result[order] = moved + gap * np.arange(len(order))
    return result


def label_ends(axes: Axes, labels: Sequence[EndLabel], size: float = 9.0) -> None:
    """Write labels to the right of the axes at the heights where their curves end.

    Each is joined to its curve's end by a thin line. Call it when the limits and the figure's size
    are final.
    """
    if not labels:
        return
    height = axes.get_window_extent().height
    gap = LINE_HEIGHT * size * axes.figure.dpi / 72.0 / height
    to_axes = axes.transData + axes.transAxes.inverted()
    ends = [min(max(float(to_axes.transform((e.x, e.y))[1]), 0.0), 1.0) for e in labels]
    for label, place in zip(labels, spread(ends, gap).tolist(), strict=True):
        axes.annotate(
            label.text,
            xy=(label.x, label.y),
            xytext=(1.02, place),
            xycoords="data",
            textcoords="axes fraction",
            ha="left",
            va="center",
            fontsize=size,
            color=label.colour,
            annotation_clip=False,
            arrowprops={
                "arrowstyle": "-",
                "color": label.colour,
                "linewidth": 0.6,
                "alpha": 0.6,
                "shrinkA": 1.0,
                "shrinkB": 4.0,
            },
        )
