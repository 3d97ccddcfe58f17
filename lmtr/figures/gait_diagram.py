"""The gait diagram of Fig. 3: coloured bars for stances, outlined white boxes for swings."""

from itertools import pairwise

from matplotlib.axes import Axes
from matplotlib.patches import Patch

from lmtr.figures.resample import ROUNDING
from lmtr.figures.style import FOOT_COLOURS, INK
from lmtr.robot.model import FEET
from lmtr.trajectory.motion import Footholds, Motion

BAR_HEIGHT = 0.72


def draw_gait(axes: Axes, motion: Motion) -> None:
    """Draw the gait diagram of a motion, feet from top to bottom in their usual order."""
    for row, foot in enumerate(FEET):
        stances, swings = phases(motion.footholds, row, float(motion.times[-1]))
        place = (row - BAR_HEIGHT / 2.0, BAR_HEIGHT)
        axes.broken_barh(
            [(begin, end - begin) for begin, end in stances],
            place,
            facecolors=FOOT_COLOURS[foot],
            edgecolors=FOOT_COLOURS[foot],
            linewidth=0.8,
            label=f"{foot} stance",
        )
        axes.broken_barh(
            [(begin, end - begin) for begin, end in swings],
            place,
            facecolors="white",
            edgecolors=INK,
            linewidth=0.8,
            label=f"{foot} swing",
        )
    axes.set_yticks(range(len(FEET)), FEET)
    axes.set_ylim(len(FEET) - 0.45, -0.55)
    axes.set_xlim(float(motion.times[0]), float(motion.times[-1]))
    axes.set_xlabel("time (s)")
    axes.set_ylabel("foot")
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0)


def phase_key() -> list[Patch]:
    """Legend entries that tell stance from swing."""
    return [
        Patch(facecolor="#8A8A8A", edgecolor="#8A8A8A", label="stance"),
        Patch(facecolor="white", edgecolor=INK, label="swing"),
    ]


def phases(
    footholds: Footholds, foot: int, end: float
) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """Stances of a foot, and the swings after them, as (begin, end) in s, by time.

    A swing that the motion's ``end`` (s) cuts short lasts until then.
    """
    mine = footholds.foot == foot
    stances = sorted(
        zip(footholds.touchdown[mine].tolist(), footholds.liftoff[mine].tolist(), strict=True)
    )
    swings = [(before[1], after[0]) for before, after in pairwise(stances)]
    if stances and stances[-1][1] <= end - ROUNDING:
        swings.append((stances[-1][1], end))
    return stances, swings
