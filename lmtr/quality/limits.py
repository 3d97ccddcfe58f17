"""The limits that fence the expert's problem in; the filter judges on which a solution lies."""

from enum import StrEnum


class Limit(StrEnum):
    """A limit that the problem was given; neither robot nor ground impose it."""

    HEIGHT = "height"
    TILT = "tilt"
    FORCE = "force"
    SWING_HEIGHT = "swing_height"
    LONGEST_SWING = "longest_swing"
    LONGEST_STANCE = "longest_stance"
    WINDOW = "window"
