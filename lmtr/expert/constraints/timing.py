"""Phase durations (E19): linear rows between the absolute times of contact changes."""

import numpy as np

from lmtr.expert.context import Context
from lmtr.expert.element import ConstraintGroup, Element, instances, symbols
from lmtr.robot.model import N_FEET


def timing(context: Context) -> ConstraintGroup:
    """Every swing, and every stance between two swings, keeps its shortest and longest duration.

    First and last stances lie between a constant and a variable; their bounds are the windows'.
    """
    times = context.quantities["times"]
    where = instances(
        {"begin": times[:, :-1].reshape(-1), "end": times[:, 1:].reshape(-1)},
        rows=np.arange(N_FEET * (times.shape[1] - 1)),
    )
    inputs = symbols(where)
    duration = inputs["end"] - inputs["begin"]
    is_swing = np.arange(times.shape[1] - 1) % 2 == 0
    limits = context.settings.limits
    low, high = (np.where(is_swing, limits.swing[k], limits.stance[k]) for k in (0, 1))
    return ConstraintGroup(
        "timing",
        [Element("duration", inputs, where, rows=duration)],
        np.tile(low, N_FEET),
        np.tile(high, N_FEET),
    )
