"""The one style of all figures: colours, fonts, sizes, saving.

Colours can be told apart with the common colour-vision deficiencies (feet: Okabe and Ito's
palette, series: Tol's), and series also differ in line style and marker, for print in grey.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import matplotlib
from matplotlib.figure import Figure

from lmtr.errors import ConfigurationError
from lmtr.robot.model import FEET

P = ParamSpec("P")
T = TypeVar("T")

FULL_WIDTH = 11.0
"""Width of a figure that fills a report page (in); fonts are sized for it."""

HALF_WIDTH = 5.4
"""Width of a figure of which two stand side by side (in)."""

RESOLUTION = 150
"""Pixels per inch of saved figures."""

FOOT_COLOURS = dict(zip(FEET, ("#0072B2", "#E69F00", "#009E73", "#CC79A7"), strict=True))
"""One colour per foot, in every figure."""

INK = "#222222"
OBSTACLE = "#767676"
FORCE = "#C8102E"
PYRAMID = "#EDA9B2"
LIMIT_BOX = "#5BA3D9"
ACCEPTED = "#117733"
REJECTED = "#CC6677"
GUESS = "#999999"

_SERIES_COLOURS = (
    "#332288",
    "#CC6677",
    "#117733",
    "#D9A300",
    "#4FA8D8",
    "#882255",
    "#44AA99",
    "#777777",
)
_SERIES_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
_SERIES_LINES = ("-", (0, (6, 1.5)), (0, (3, 1, 1, 1)), (0, (1.5, 1)))

_RC = {
    "font.family": "DejaVu Sans",
    "font.size": 10.0,
    "axes.titlesize": 11.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 10.0,
    "xtick.labelsize": 9.0,
    "ytick.labelsize": 9.0,
    "legend.fontsize": 9.0,
    "legend.frameon": False,
    "legend.handlelength": 2.4,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": "#555555",
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.7,
    "lines.markersize": 5.0,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "figure.titlesize": 12.0,
    "figure.titleweight": "bold",
    # Text stays text in vector files, so that a journal can set and search it.
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
    "svg.hashsalt": "lmtr",
}


@dataclass(frozen=True)
class SeriesStyle:
    """How one replanner or model looks in every figure."""

    colour: str
    marker: str
    line: str | tuple[int, tuple[float, ...]]

    @property
    def drawn(self) -> dict[str, Any]:
        """The same as arguments of Matplotlib's ``plot``."""
        return {"color": self.colour, "linestyle": self.line, "marker": self.marker}


Styles = Mapping[str, SeriesStyle]


def series_styles(names: Iterable[str]) -> dict[str, SeriesStyle]:
    """Styles of replanners or models, by their place in ``names``.

    Hand the result for the full list to every figure that shows only some of them.
    """
    return {
        name: SeriesStyle(
            colour=_SERIES_COLOURS[k % len(_SERIES_COLOURS)],
            marker=_SERIES_MARKERS[k % len(_SERIES_MARKERS)],
            line=_SERIES_LINES[(k + k // len(_SERIES_COLOURS)) % len(_SERIES_LINES)],
        )
        for k, name in enumerate(names)
    }


def styles_for(names: Iterable[str], styles: Styles | None) -> Styles:
    """The given styles, which must cover ``names``, or fresh ones.

    Raises:
        ConfigurationError: A name has no style.
    """
    names = list(names)
    if styles is None:
        return series_styles(names)
    missing = [name for name in names if name not in styles]
    if missing:
        raise ConfigurationError(
            f"figure styles: every series needs a style, {missing} have none; "
            "make the styles from the names of all series"
        )
    return styles


def styled(draw: Callable[P, T]) -> Callable[P, T]:
    """Decorate a function that draws, so that it does so in the house style."""

    @wraps(draw)
    def in_style(*args: P.args, **kwargs: P.kwargs) -> T:
        with matplotlib.rc_context(_RC):
            return draw(*args, **kwargs)

    return in_style


def save(figure: Figure, path: Path, resolution: int = RESOLUTION) -> Path:
    """Write a figure at its own size and ``resolution`` pixels per inch; returns the path.

    The ending of ``path`` names its kind, .png, .pdf or .svg. None says when it was made, so that
    the same figure is the same file.
    """
    undated = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}.get(path.suffix)
    with matplotlib.rc_context(_RC):
        figure.savefig(path, dpi=resolution, metadata=undated)
    return path
