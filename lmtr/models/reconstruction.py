"""Errors of predicted segments in units that a person can judge."""

import numpy as np

from lmtr.arrays import Array
from lmtr.robot.model import FEET
from lmtr.settings import NonNegative, Settings
from lmtr.trajectory.nodes import POSITION, VALUE
from lmtr.trajectory.sample import sample_feet
from lmtr.vectors.layout import SEGMENT_LAYOUT
from lmtr.vectors.segment_vector import decode_segment


class ReconstructionErrors(Settings):
    """Means over segments and over all quantities of a kind.

    Attributes:
        base_position_mm: Distance of the base nodes from the expert's (mm).
        times_ms: Absolute error of the contact changes (ms).
        second_foothold_mm: Distance of the second footholds, the plan's next ones (mm).
        forces_weights: Absolute error per component of the force nodes' values, over the robot's
            weight.
        epoch_feet_mm: Distance of the feet at the epoch, by which they jump at replanning (mm).
    """

    base_position_mm: NonNegative
    times_ms: NonNegative
    second_foothold_mm: NonNegative
    forces_weights: NonNegative
    epoch_feet_mm: NonNegative


def reconstruction_errors(tau: Array, tau_hat: Array, weight: float) -> ReconstructionErrors:
    """Compare predicted with expert segments.

    Args:
        tau: Expert segments, (B, 264) in SI units.
        tau_hat: Predictions, (B, 264) in SI units.
        weight: The robot's weight (N).
    """
    error = SEGMENT_LAYOUT.unpack(np.asarray(tau_hat - tau))
    by_foot = {
        name: np.stack([error[f"{foot}_{name}"] for foot in FEET])
        for name in ("times", "second_foothold", "forces")
    }
    return ReconstructionErrors(
        base_position_mm=1e3 * _mean_distance(error["base_nodes"][..., VALUE, POSITION]),
        times_ms=1e3 * float(np.abs(by_foot["times"]).mean()),
        second_foothold_mm=1e3 * _mean_distance(by_foot["second_foothold"]),
        forces_weights=float(np.abs(by_foot["forces"][..., VALUE, :]).mean()) / weight,
        epoch_feet_mm=1e3 * _mean_distance(_epoch_feet(tau_hat) - _epoch_feet(tau)),
    )


def _epoch_feet(tau: Array) -> Array:
    """Feet at the epochs of segments (B, 264), (B, 4, 3) in m."""
    segment = decode_segment(tau)
    return sample_feet(segment, np.zeros((*segment.batch_shape, 1))).position[:, 0]


def _mean_distance(offsets: Array) -> float:
    return float(np.linalg.norm(offsets, axis=-1).mean())
