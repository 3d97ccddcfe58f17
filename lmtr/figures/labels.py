"""Labels written beside what they name, where they cover least."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.patheffects import withStroke
from matplotlib.text import Annotation, Text
from matplotlib.transforms import Bbox

from lmtr.arrays import Array

DISTANCES = (7.0, 14.0, 24.0)
"""Distances of a label from its point that are tried, the nearest first (pt)."""

DIRECTIONS = (0.0, 45.0, -45.0, 180.0, 135.0, -135.0, 90.0, -90.0)
"""Directions that are tried, the best to read first (deg)."""

SAMPLES = 40
"""Points of each drawn line that a label should not cover."""

FAR = 0.4
"""How much worse a label is for one more direction or distance tried, in covered points."""

_HALO = [withStroke(linewidth=2.2, foreground="white")]


@dataclass(frozen=True)
class PointLabel:
    """A label of a point.

    Attributes:
        text: What it says.
        x: Where the point lies, in the data's units.
        y: Likewise.
        colour: That of the point.
    """

    text: str
    x: float
    y: float
    colour: str


def label_points(axes: Axes, labels: Sequence[PointLabel], size: float = 9.0) -> list[Text]:
    """Write each label where it covers least of what is drawn, of other labels and of the frame.

    A thin line leads from it to its point.

    Call it when everything is drawn and the limits are final.
    """
    figure = axes.figure
    canvas = FigureCanvasAgg(figure)
    drawn = _drawn(axes)
    frame = axes.get_window_extent()
    taken: list[Bbox] = []
    texts: list[Text] = []
    for label in labels:
        text = axes.annotate(
            label.text,
            (label.x, label.y),
            xytext=(0, 0),
            textcoords="offset points",
            fontsize=size,
            color=label.colour,
            path_effects=_HALO,
            zorder=6.0,
            arrowprops={"arrowstyle": "-", "color": label.colour, "lw": 0.6, "shrinkB": 3.0},
        )
        best, least = (0.0, 0.0), np.inf
        places = [(distance, angle) for distance in DISTANCES for angle in DIRECTIONS]
        for number, (distance, angle) in enumerate(places):
            _place(text, distance, angle)
            box = _box(text, canvas)
            cost = FAR * number + _covered(box, drawn) + _clashes(box, taken, frame)
            if cost < least:
                best, least = (distance, angle), cost
        _place(text, *best)
        taken.append(_box(text, canvas))
        texts.append(text)
    return texts


def _place(text: Annotation, distance: float, angle: float) -> None:
    """Move an annotation to a distance (pt) and direction (deg) from its point."""
    across, up = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    text.set_position((distance * across, distance * up))
    text.set_horizontalalignment("left" if across > 0.1 else "right" if across < -0.1 else "center")
    text.set_verticalalignment("bottom" if up > 0.1 else "top" if up < -0.1 else "center")


def _box(text: Annotation, canvas: FigureCanvasAgg) -> Bbox:
    """The rectangle of a label without its line."""
    renderer = canvas.get_renderer()
    text.update_positions(renderer)
    return Text.get_window_extent(text, renderer)


def _drawn(axes: Axes) -> Array:
    """Points along everything that is drawn, (k, 2) in pixels."""
    points = [np.zeros((0, 2))]
    for line in axes.lines:
        path = line.get_transform().transform(np.asarray(line.get_xydata(), dtype=float))
        path = path[np.isfinite(path).all(axis=1)]
        if len(path) > 1:
            places = np.linspace(0.0, len(path) - 1.0, SAMPLES * (len(path) - 1))
            path = np.stack(
                [np.interp(places, np.arange(len(path)), path[:, k]) for k in (0, 1)], axis=-1
            )
        points.append(path)
    return np.concatenate(points)


def _covered(box: Bbox, points: Array) -> float:
    inside = (points >= box.min) & (points <= box.max)
    return float(inside.all(axis=1).sum())


def _clashes(box: Bbox, taken: Sequence[Bbox], frame: Bbox) -> float:
    """A large number for each label that is covered, and for leaving the frame."""
    outside = bool(np.any(box.min < frame.min) or np.any(box.max > frame.max))
    return 1e3 * (sum(box.overlaps(other) for other in taken) + outside)
