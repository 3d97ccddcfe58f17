"""The segment vector τ of 264 numbers, scope s = (0.8 s, 1 swing per leg) (Sec. 4.3)."""

import numpy as np

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.robot.model import FEET
from lmtr.trajectory.nodes import SWING_POSITION, SWING_VELOCITY
from lmtr.trajectory.trajectory import FORCE_PIECES, Trajectory
from lmtr.vectors.layout import SEGMENT_LAYOUT, SEGMENT_NODES, SEGMENT_STANCES

MIN_PHASE = 0.05
"""Shortest phase (s) that decoding lets through; the expert's own phases are longer."""


def encode_segment(segment: Trajectory) -> Array:
    """The vectors τ (..., 264) of segments given in _S with time counted from the epoch.

    Raises:
        DataError: The trajectory has another scope, starts at another time, or pushes the ground
            at the force nodes that it shares with its swing (τ could not give that back).
    """
    _require_segment(segment)
    parts = {"base_nodes": segment.base_nodes}
    for index, foot in enumerate(FEET):
        forces = segment.force_nodes[..., index, :, :, :, :]
        parts[f"{foot}_times"] = segment.contact_times[..., index, :]
        parts[f"{foot}_first_foothold"] = segment.footholds[..., index, 0, :]
        parts[f"{foot}_second_foothold"] = segment.footholds[..., index, 1, :]
        parts[f"{foot}_swing_position"] = segment.swing_nodes[..., index, 0, SWING_POSITION]
        parts[f"{foot}_swing_velocity"] = segment.swing_nodes[..., index, 0, SWING_VELOCITY]
        parts[f"{foot}_forces"] = np.stack(
            [forces[..., 0, :-1, :, :], forces[..., 1, 1:, :, :]], axis=-4
        )
    return SEGMENT_LAYOUT.pack(parts)


def decode_segment(tau: Array) -> Trajectory:
    """The segments that vectors τ (..., 264) describe, in _S, with time counted from the epoch.

    A network's contact times need not ascend: see :func:`ordered_times`. Everything else is taken
    as it is, foot heights included.
    """
    parts = SEGMENT_LAYOUT.unpack(np.asarray(tau, dtype=np.float64))

    def by_foot(name: str) -> Array:
        """The field of all four feet, (..., 4, *shape)."""
        axis = parts["base_nodes"].ndim - 3
        return np.stack([parts[f"{foot}_{name}"] for foot in FEET], axis=axis)

    free = by_foot("forces")  # (..., 4, 2, FORCE_PIECES, 2, 3)
    batch = free.shape[:-5]
    forces = np.zeros((*batch, len(FEET), SEGMENT_STANCES, FORCE_PIECES + 1, 2, 3))
    forces[..., 0, :-1, :, :] = free[..., 0, :, :, :]
    forces[..., 1, 1:, :, :] = free[..., 1, :, :, :]
    return Trajectory(
        base_start=np.zeros(batch),
        base_nodes=parts["base_nodes"],
        contact_times=ordered_times(by_foot("times")),
        footholds=np.stack([by_foot("first_foothold"), by_foot("second_foothold")], axis=-2),
        swing_nodes=np.concatenate([by_foot("swing_position"), by_foot("swing_velocity")], axis=-1)[
            ..., None, :
        ],
        force_nodes=forces,
    )


def ordered_times(times: Array) -> Array:
    """Contact times (..., 4) in s made ascending, each phase at least ``MIN_PHASE`` long.

    Lift-off is kept, for it is the change that a plan carries out first; a touch-down or end that
    comes too early is put off, and a first stance that begins too late begins earlier. Times that
    obey already are returned unchanged.
    """
    start, liftoff, touchdown, end = np.moveaxis(times, -1, 0)
    touchdown = np.maximum(touchdown, liftoff + MIN_PHASE)
    end = np.maximum(end, touchdown + MIN_PHASE)
    start = np.minimum(start, liftoff - MIN_PHASE)
    return np.stack([start, liftoff, touchdown, end], axis=-1)


def _require_segment(segment: Trajectory) -> None:
    nodes, stances = segment.base_nodes.shape[-3], segment.n_stances
    if (nodes, stances) != (SEGMENT_NODES, SEGMENT_STANCES):
        raise DataError(
            f"segment: τ holds {SEGMENT_NODES} base nodes and {SEGMENT_STANCES} stances per foot, "
            f"got {nodes} and {stances}; cut the trajectory to this scope first"
        )
    if np.any(np.abs(segment.base_start) > 1e-9):
        raise DataError(
            f"segment: base_start must be 0 s, got {segment.base_start.tolist()}; "
            "give the trajectory as seen from its epoch"
        )
    shared = np.stack([segment.force_nodes[..., 0, -1, :, :], segment.force_nodes[..., 1, 0, :, :]])
    if np.any(shared != 0.0):
        raise DataError(
            "segment: force nodes shared with the swing must be zero, got up to "
            f"{np.abs(shared).max():.3g} N or N/s; τ has no place for them"
        )
