"""Base nodes of a window whose epoch lies between the solution's knots.

The solution's base is a cubic spline on its own knots; the window's nodes lie elsewhere, so no
Hermite spline on them is the same curve. Nodes that take the solution's value and slope leave up
to 0.2 mm and 0.4 mrad in between, where the solution's jerk jumps. Nodes fitted to samples by
least squares halve that and more. The pose at the epoch is kept exactly, for it is the origin of
the segment frame. If the knots coincide, the fit is the solution itself, to rounding.
"""

import numpy as np

from lmtr.arrays import Array
from lmtr.spline import hermite
from lmtr.trajectory.sample import sample_base
from lmtr.trajectory.trajectory import BASE_STEP, Trajectory
from lmtr.vectors.layout import SEGMENT_NODES

_SAMPLES_PER_STEP = 10

VELOCITY_WEIGHT = 0.02
"""Weight (s) of velocity errors beside position errors: about 0.1 mm counts as much as 5 mm/s."""


def _design() -> Array:
    """Values, then weighted derivatives, at the samples, as linear functions of the nodes.

    Shape (2·M, 2·SEGMENT_NODES): M samples; nodes in order, each value before derivative.
    """
    count = _SAMPLES_PER_STEP * (SEGMENT_NODES - 1) + 1
    index = np.minimum(np.arange(count) // _SAMPLES_PER_STEP, SEGMENT_NODES - 2)
    u = np.arange(count) / _SAMPLES_PER_STEP - index
    unit = np.eye(2 * SEGMENT_NODES).reshape(2 * SEGMENT_NODES, SEGMENT_NODES, 2)
    ends = (unit[:, index, 0], unit[:, index, 1], unit[:, index + 1, 0], unit[:, index + 1, 1])
    values = hermite.value(u, *ends, BASE_STEP)
    slopes = hermite.first_derivative(u, *ends, BASE_STEP)
    return np.concatenate([values, VELOCITY_WEIGHT * slopes], axis=-1).T


_DESIGN = _design()
_FIT = np.linalg.pinv(_DESIGN[:, 1:])  # of all nodes but the first value


def resampled_base(trajectory: Trajectory, epochs: Array) -> Array:
    """Base nodes every ``BASE_STEP`` from each epoch on, in the trajectory's frame.

    Args:
        trajectory: One solution (no batch axes).
        epochs: (E,) in s.

    Returns:
        Nodes as in :class:`Trajectory`, (E, SEGMENT_NODES, 2, 6).
    """
    count = len(_DESIGN) // 2
    times = epochs[:, None] + BASE_STEP / _SAMPLES_PER_STEP * np.arange(count)
    base = sample_base(trajectory, times.reshape(-1))
    values = np.concatenate([base.position, base.rpy], axis=-1)
    slopes = np.concatenate([base.velocity, base.rpy_rate], axis=-1)
    shape = (len(epochs), count, 6)
    samples = np.concatenate(
        [values.reshape(shape), VELOCITY_WEIGHT * slopes.reshape(shape)], axis=1
    )
    first = samples[:, :1]
    others = _FIT @ (samples - _DESIGN[:, :1] * first)
    return np.concatenate([first, others], axis=1).reshape(len(epochs), SEGMENT_NODES, 2, 6)
