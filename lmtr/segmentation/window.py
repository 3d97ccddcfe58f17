"""The sliding window: an expert's trajectory cut to the segment's scope, without refitting.

Per foot, the window holds two stances and the swing between them. If the foot stands at the epoch,
that stance is the first one; if it swings, the stance before it is. So phases may begin before the
epoch and end beyond the window, asynchronously with the base nodes and the other feet (Sec. 4.1).
"""

import numpy as np

from lmtr.arrays import Array, Flags
from lmtr.errors import DataError
from lmtr.robot.model import N_FEET
from lmtr.segmentation.resampling import resampled_base
from lmtr.trajectory.nodes import POSITION, RATE, RPY
from lmtr.trajectory.sample import sample_base, sample_feet
from lmtr.trajectory.trajectory import BASE_STEP, Trajectory
from lmtr.vectors.layout import SEGMENT_DURATION, SEGMENT_STANCES
from lmtr.vectors.state import segment_frame

RESTING_SPEED = 0.02
"""A base node slower than this (m/s), and than ``RESTING_RATE`` in its angles, may be at rest."""

RESTING_RATE = 0.05
"""See ``RESTING_SPEED`` (rad/s)."""

_ROUNDING = 1e-9


def valid_epochs(trajectory: Trajectory, epochs: Array) -> Flags:
    """Which epochs make a window of the segment's scope.

    One swing per leg must suffice for the window, so every foot's second stance must exist and
    last until the window's end; and the window must end before the solution comes to rest.

    Args:
        trajectory: One solution (no batch axes).
        epochs: (E,) in s.

    Returns:
        (E,).
    """
    first = sample_feet(trajectory, epochs).stance  # (E, 4)
    exists = (first + SEGMENT_STANCES <= trajectory.n_stances).all(axis=-1)
    last = np.minimum(first + SEGMENT_STANCES, trajectory.n_stances) - 1
    ends = trajectory.contact_times[np.arange(N_FEET), 2 * last + 1]
    window_end = epochs + SEGMENT_DURATION
    lasts = (ends >= window_end[:, None] - _ROUNDING).all(axis=-1)
    inside = (epochs >= trajectory.base_start - _ROUNDING) & (
        window_end <= rest_time(trajectory) + _ROUNDING
    )
    return np.asarray(exists & lasts & inside)


def rest_time(trajectory: Trajectory) -> float:
    """When a solution (no batch axes) comes to rest: feet down and base still from then on (s)."""
    speed = np.linalg.norm(trajectory.base_nodes[:, RATE, POSITION], axis=-1)
    rate = np.linalg.norm(trajectory.base_nodes[:, RATE, RPY], axis=-1)
    moving = np.flatnonzero((speed > RESTING_SPEED) | (rate > RESTING_RATE))
    # The base is still moving until the node after the last moving one.
    still = min(int(moving[-1]) + 1, len(speed) - 1) if len(moving) else 0
    landed = float(trajectory.touchdown_times.max(initial=-np.inf))
    return max(float(trajectory.base_start) + BASE_STEP * still, landed)


def cut(trajectory: Trajectory, epochs: Array) -> Trajectory:
    """The windows of one solution at several epochs, each in its segment frame and epoch time.

    Feet, forces and contacts are the solution's own. So is the base for epochs on its knots; for
    others its nodes are resampled, see :mod:`lmtr.segmentation.resampling`.

    Args:
        trajectory: One solution (no batch axes), in any frame with z up.
        epochs: (E,) in s.

    Returns:
        E segments, batched (E,).

    Raises:
        DataError: An epoch is not among the :func:`valid_epochs`.
    """
    epochs = np.asarray(epochs, dtype=float)
    refused = epochs[~valid_epochs(trajectory, epochs)]
    if len(refused):
        raise DataError(
            f"segmentation: no window of {SEGMENT_DURATION} s and one swing per leg begins at "
            f"epoch {refused[0]:.3f} s of a solution that rests from {rest_time(trajectory):.3f} s "
            f"({len(refused)} of {len(epochs)} epochs refused); keep to valid epochs"
        )
    feet = np.arange(N_FEET)[:, None]
    first = sample_feet(trajectory, epochs).stance[..., None]  # (E, 4, 1)
    stances = first + np.arange(SEGMENT_STANCES)
    changes = 2 * first + np.arange(2 * SEGMENT_STANCES)
    windows = Trajectory(
        base_start=epochs,
        base_nodes=resampled_base(trajectory, epochs),
        contact_times=trajectory.contact_times[feet, changes],
        footholds=trajectory.footholds[feet, stances],
        swing_nodes=trajectory.swing_nodes[feet, stances[..., :-1]],
        force_nodes=trajectory.force_nodes[feet, stances],
    )
    return windows.seen_from(segment_frame(sample_base(trajectory, epochs)), epochs)
