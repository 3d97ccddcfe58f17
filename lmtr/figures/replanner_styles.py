"""One look per replanner in all figures of a study: by family, latent dimension and policy.

The library is vermilion and the unimodal regressor grey; LMTR-n goes from light to dark with n, so
that a trend over n is seen as one. What selects among several modes is dashed and filled
differently from what takes the nearest.
"""

from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex

from lmtr.figures.style import INK, SeriesStyle

LIBRARY_COLOUR = "#D55E00"
UNIMODAL_COLOUR = "#7A7A7A"
LARGEST = 16
"""Latent dimension (and beyond) that is drawn darkest."""

_LIGHT, _DARK = 0.30, 0.95
_MARKERS = {"nearest": "o", "selected": "D", "gaussian": "^", "prior": "P", "zero": "X"}
_DASHED = (0, (5, 1.6))
_DOTTED = (0, (1.4, 1.2))


def replanner_style(latent: int | None, policy: str = "nearest") -> SeriesStyle:
    """The look of a replanner.

    Args:
        latent: n of its model, 0 for the unimodal regressor, None for the trajectory library.
        policy: How it selects its mode or plan, by the name that evaluations have for it.
    """
    line: Any = {"nearest": "-", "selected": _DASHED}.get(policy, _DOTTED)
    marker = _MARKERS.get(policy, "v")
    if latent is None:
        return SeriesStyle(LIBRARY_COLOUR, "s" if policy == "nearest" else marker, line)
    if latent == 0:
        return SeriesStyle(UNIMODAL_COLOUR, "X", (0, (6, 1.5, 1.5, 1.5)))
    return SeriesStyle(latent_colour(latent), marker, line)


def expert_style() -> SeriesStyle:
    """The look of the line of reference."""
    return SeriesStyle(INK, "*", _DOTTED)


def latent_colour(latent: int) -> str:
    """Colour of LMTR-n, light green to dark blue on a logarithmic scale of n ≥ 1."""
    share = min(1.0, float(np.log2(1.0 + latent) / np.log2(1.0 + LARGEST)))
    # The map's dark end is at 0; its yellow end is too light for lines on white.
    place = 1.0 - (_LIGHT + (_DARK - _LIGHT) * share)
    return str(to_hex(colormaps["viridis"](place)))
