"""What modes are coloured by: properties of the segments that they stand for (Fig. 2)."""

import numpy as np

from lmtr.figures.modes import Colouring
from lmtr.trajectory.nodes import HEIGHT, YAW
from lmtr.trajectory.trajectory import Trajectory


def segment_properties(segments: Trajectory) -> list[Colouring]:
    """Strides of the front feet, change of yaw and height of the base, and the foot that begins.

    Args:
        segments: Batch (N) of segments, _S.

    Returns:
        One for each panel, with values (N,) in the unit that its label names.
    """
    strides = np.linalg.norm(segments.footholds[:, :, -1] - segments.footholds[:, :, 0], axis=-1)
    change = segments.base_nodes[:, -1, 0] - segments.base_nodes[:, 0, 0]
    return [
        Colouring("stride of LF (m)", strides[:, 0]),
        Colouring("stride of RF (m)", strides[:, 1]),
        Colouring("change of yaw (deg)", np.degrees(change[:, YAW]), diverging=True),
        Colouring("change of height (mm)", 1e3 * change[:, HEIGHT], diverging=True),
        Colouring("foot that lifts first", segments.liftoff_times[:, :, 0].argmin(axis=1), True),
    ]
