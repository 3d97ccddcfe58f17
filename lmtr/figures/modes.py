"""The distribution of expert modes z, coloured by properties of their segments (Fig. 2)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D

from lmtr.arrays import Array, Indices
from lmtr.errors import DataError
from lmtr.figures.style import FOOT_COLOURS, FULL_WIDTH, styled
from lmtr.robot.model import FEET, N_FEET

COLUMNS = 3
"""Panels in one row, at most."""

NEIGHBOURHOOD_COLOURS = ("#0072B2", "#D55E00", "#E6A700")
NEIGHBOURHOOD_MARKERS = ("o", "^", "s")
"""One per neighbourhood of tasks; further ones begin again."""

MOST_POINTS = 4000
"""More modes than this are thinned evenly: they would only hide each other."""

LIMIT_SHARE = 0.998
"""The axes reach over this share of the modes on either side; the few beyond are not drawn."""

PANEL_HEIGHT = 3.7
"""Height of a row of panels (in)."""

ELEVATION, AZIMUTH = 18.0, -52.0
"""View of the three-dimensional panels (deg)."""


Rectangle = tuple[float, float, float, float]
"""Left, bottom, width and height, as parts of the figure."""


@dataclass(frozen=True)
class Colouring:
    """A property that colours the points of one panel.

    Attributes:
        label: Its name with its unit.
        values: (n,); indices of feet if ``is_foot``.
        is_foot: Whether values are feet, drawn in their colours.
        diverging: Whether zero is in the middle of the colours.
    """

    label: str
    values: Array
    is_foot: bool = False
    diverging: bool = False


@styled
def modes_figure(
    modes: Array,
    colourings: Sequence[Colouring],
    dimensions: tuple[int, ...] | None = None,
    neighbourhoods: Sequence[Array] = (),
) -> Figure:
    """Scatter of modes, one panel per property.

    Args:
        modes: (n, dim z), the means that the encoder gives.
        colourings: The panels.
        dimensions: Two or three latent dimensions to show; by default the three, or two, of
            largest variance, which are those that the model uses.
        neighbourhoods: Modes (k, dim z) of tasks that are much alike, for a last panel; where one
            of them has several clusters, the choice of mode is multimodal.

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
    panels = len(colourings) + bool(len(neighbourhoods))
    rows = -(-panels // COLUMNS)
    columns = -(-panels // rows)
    figure = Figure(figsize=(FULL_WIDTH, PANEL_HEIGHT * rows))
    kept = _kept(modes, shown)
    for number in range(panels):
        cell = _Cell(number // columns, number % columns, rows, columns)
        axes = cell.axes(figure, len(shown))
        if number < len(colourings):
            title = colourings[number].label
            _draw_panel(axes, cell.bar(figure), modes[kept], shown, colourings[number], kept)
        else:
            title = "modes of alike tasks"
            _draw_neighbourhoods(axes, modes[kept], neighbourhoods, shown)
        cell.title(figure, f"({chr(ord('a') + number)}) {title}")
        _draw_frame(axes, modes, shown)
    return figure


@dataclass(frozen=True)
class _Cell:
    """The place of a panel, laid out by hand.

    Automatic layouts leave half of the paper empty around axes in three dimensions.
    """

    row: int
    column: int
    rows: int
    columns: int

    def axes(self, figure: Figure, dimensions: int) -> Axes3D:
        """Axes3D of the points."""
        if dimensions == 3:
            return figure.add_axes(self._part(-0.06, 0.12, 1.05, 0.86), projection="3d")
        return figure.add_axes(self._part(0.16, 0.33, 0.80, 0.57))

    def bar(self, figure: Figure) -> Axes3D:
        """Axes3D of the colour bar."""
        return figure.add_axes(self._part(0.2, 0.105, 0.66, 0.026))

    def title(self, figure: Figure, text: str) -> None:
        """Write the headline of the panel."""
        x, y, _, _ = self._part(0.04, 0.985, 0.0, 0.0)
        figure.text(x, y, text, va="top", weight="bold", size=10)

    def _part(
        self, x: float, y: float, width: float, height: float
    ) -> tuple[float, float, float, float]:
        """A part of the cell as a part of the figure."""
        left, bottom = self.column, self.rows - 1 - self.row
        return (
            (left + x) / self.columns,
            (bottom + y) / self.rows,
            width / self.columns,
            height / self.rows,
        )


def _kept(modes: Array, shown: tuple[int, ...]) -> Indices:
    """Points that are drawn: those within the limits, and not more than can be told apart."""
    inside = np.ones(len(modes), dtype=bool)
    for k in shown:
        low, high = np.quantile(modes[:, k], [1.0 - LIMIT_SHARE, LIMIT_SHARE])
        inside &= (modes[:, k] >= low) & (modes[:, k] <= high)
    kept = np.flatnonzero(inside)
    return np.asarray(kept[:: -(-len(kept) // MOST_POINTS)])


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
    axes: Axes3D,
    bar_axes: Axes3D,
    modes: Array,
    shown: tuple[int, ...],
    colouring: Colouring,
    kept: Indices,
) -> None:
    values = np.asarray(colouring.values, dtype=float)
    if colouring.is_foot:
        colours: dict[str, Any] = {
            "cmap": ListedColormap([FOOT_COLOURS[foot] for foot in FEET]),
            "norm": BoundaryNorm(np.arange(N_FEET + 1) - 0.5, N_FEET),
        }
    else:
        # Outliers must not take the colour scale away from the bulk.
        low, high = np.quantile(values, [0.02, 0.98])
        if colouring.diverging:
            high = max(abs(low), abs(high))
            low = -high
        colours = {
            "cmap": "PuOr" if colouring.diverging else "viridis",
            "vmin": low,
            "vmax": high,
        }
    points = axes.scatter(
        *(modes[:, k] for k in shown),
        c=values[kept],
        s=6,
        linewidths=0,
        alpha=0.75,
        rasterized=True,
        **colours,
    )
    # The bar shows the pure colours, the points being translucent.
    scale = ScalarMappable(points.norm, points.cmap)
    bar = axes.figure.colorbar(scale, cax=bar_axes, orientation="horizontal")
    bar.outline.set_visible(False)
    if colouring.is_foot:
        bar.set_ticks(range(N_FEET), labels=FEET)
        bar.ax.tick_params(length=0)
    else:
        bar.locator = MaxNLocator(5)
        bar.update_ticks()


def _draw_neighbourhoods(
    axes: Axes3D, modes: Array, neighbourhoods: Sequence[Array], shown: tuple[int, ...]
) -> None:
    axes.scatter(
        *(modes[:, k] for k in shown), c="#C8C8C8", s=3, linewidths=0, alpha=0.35, rasterized=True
    )
    handles = []
    for number, each in enumerate(neighbourhoods):
        colour = NEIGHBOURHOOD_COLOURS[number % len(NEIGHBOURHOOD_COLOURS)]
        marker = NEIGHBOURHOOD_MARKERS[number % len(NEIGHBOURHOOD_MARKERS)]
        # In three dimensions far points would be faded, as if they were few.
        unfaded = {"depthshade": False} if len(shown) == 3 else {}
        axes.scatter(
            *(each[:, k] for k in shown),
            c=colour,
            marker=marker,
            s=24,
            linewidths=0.4,
            edgecolors="white",
            **unfaded,
        )
        handles.append(Line2D([], [], color=colour, marker=marker, ls="", label=f"{number + 1}"))
    axes.legend(
        handles=handles,
        title="neighbourhood of tasks",
        title_fontsize=9,
        loc="upper center",
        # Two dimensions have an axis with a label below; three have none there.
        bbox_to_anchor=(0.53, 0.055) if len(shown) == 3 else (0.5, -0.2),
        ncols=len(handles),
        columnspacing=1.0,
        handletextpad=0.1,
    )


def _draw_frame(axes: Axes3D, modes: Array, shown: tuple[int, ...]) -> None:
    """Limits around the bulk, few ticks, and a light frame."""
    for name, k in zip("xyz", shown, strict=False):
        low, high = np.quantile(modes[:, k], [1.0 - LIMIT_SHARE, LIMIT_SHARE])
        pad = 0.05 * max(high - low, 1e-6)
        axes.set(**{f"{name}label": f"$z_{{{k + 1}}}$ (–)", f"{name}lim": (low - pad, high + pad)})
        axis = getattr(axes, f"{name}axis")
        axis.set_major_locator(MaxNLocator(4, integer=True))
        axis.set_tick_params(labelsize=8, pad=-1.5 if len(shown) == 3 else 3)
        if len(shown) == 3:
            axis.labelpad = -4.0
            axis.pane.set_facecolor("#FAFAFA")
            axis.pane.set_edgecolor("#CCCCCC")
    if len(shown) == 3:
        axes.view_init(elev=ELEVATION, azim=AZIMUTH)
        axes.set_box_aspect((1.0, 1.0, 0.85), zoom=0.98)
