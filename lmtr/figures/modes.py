"""The distribution of expert modes z, coloured by properties of their segments (Fig. 2)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.figures.style import FOOT_COLOURS, FULL_WIDTH, styled
from lmtr.robot.model import FEET, N_FEET

COLUMNS = 3
"""Panels in one row, at most."""


@dataclass(frozen=True)
class Colouring:
    """A property that colours the points of one panel.

    Attributes:
        label: Its name with its unit.
        values: (n,); indices of feet if ``is_foot``.
        is_foot: Whether values are feet, drawn in their colours.
    """

    label: str
    values: Array
    is_foot: bool = False


@styled
def modes_figure(
    modes: Array, colourings: Sequence[Colouring], dimensions: tuple[int, ...] | None = None
) -> Figure:
    """Scatter of modes, one panel per property.

    Args:
        modes: (n, dim z), the means that the encoder gives.
        colourings: The panels.
        dimensions: Two or three latent dimensions to show; by default the three, or two, of
            largest variance, which are those that the model uses.

    Raises:
        DataError: Fewer than two latent dimensions, no panel, or values of another length.
    """
    shown = _dimensions(modes, dimensions)
    if not colourings:
        raise DataError("modes figure: needs at least one property to colour by, got none")
    for colouring in colourings:
        if np.shape(colouring.values) != (len(modes),):
            raise DataError(
                f"modes figure: {colouring.label!r} must have one value per mode, got shape "
                f"{np.shape(colouring.values)} for {len(modes)} modes"
            )
    rows = -(-len(colourings) // COLUMNS)
    columns = -(-len(colourings) // rows)
    figure = Figure(figsize=(FULL_WIDTH, 3.5 * rows), layout="constrained")
    for k, colouring in enumerate(colourings):
        projection = "3d" if len(shown) == 3 else None
        axes = figure.add_subplot(rows, columns, k + 1, projection=projection)
        _draw_panel(figure, axes, modes, shown, colouring)
        axes.set_title(f"({chr(ord('a') + k)}) {colouring.label}", fontsize=10)
    return figure


def _dimensions(modes: Array, dimensions: tuple[int, ...] | None) -> tuple[int, ...]:
    if modes.ndim != 2 or modes.shape[1] < 2 or not len(modes):
        raise DataError(
            f"modes figure: needs modes (n, 2 or more), got shape {modes.shape}; "
            "choose a model with at least two latent dimensions"
        )
    if dimensions is None:
        by_variance = np.argsort(-modes.var(axis=0), kind="stable")
        return tuple(sorted(int(k) for k in by_variance[: min(3, modes.shape[1])]))
    if len(dimensions) not in (2, 3) or max(dimensions) >= modes.shape[1]:
        raise DataError(
            f"modes figure: two or three of {modes.shape[1]} latent dimensions can be shown, "
            f"got {dimensions}"
        )
    return dimensions


def _draw_panel(
    figure: Figure, axes: Axes3D, modes: Array, shown: tuple[int, ...], colouring: Colouring
) -> None:
    values = np.asarray(colouring.values, dtype=float)
    if colouring.is_foot:
        colours: dict[str, Any] = {
            "cmap": ListedColormap([FOOT_COLOURS[foot] for foot in FEET]),
            "norm": BoundaryNorm(np.arange(N_FEET + 1) - 0.5, N_FEET),
        }
    else:
        # Outliers must not take the colour scale away from the bulk.
        low, high = np.quantile(values, [0.01, 0.99])
        colours = {"cmap": "viridis", "vmin": low, "vmax": high}
    points = axes.scatter(
        *(modes[:, k] for k in shown), c=values, s=5, linewidths=0, alpha=0.7, **colours
    )
    # The bar shows the pure colours, the points being translucent.
    scale = ScalarMappable(points.norm, points.cmap)
    pad = 0.12 if len(shown) == 3 else 0.03
    bar = figure.colorbar(scale, ax=axes, shrink=0.7, pad=pad)
    if colouring.is_foot:
        bar.set_ticks(range(N_FEET), labels=FEET)
    for name, k in zip("xyz", shown, strict=False):
        axes.set(**{f"{name}label": f"$z_{{{k + 1}}}$ (–)"})
