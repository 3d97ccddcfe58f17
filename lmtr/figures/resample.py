"""A sampled motion at other times, for pictures that follow each other faster than its samples."""

import numpy as np

from lmtr.arrays import Array, Flags
from lmtr.robot.model import N_FEET
from lmtr.trajectory.motion import Footholds, Motion

ROUNDING = 1e-6
"""A stance that ends less than this (s) before its motion lasts to the motion's end."""


def resampled(motion: Motion, times: Array) -> Motion:
    """The motion at ``times`` (M,) in s, linear between samples.

    Contacts come from the footholds' exact times, not from the samples: a standing foot is at its
    foothold and a swinging one has no force, so that no foot slides or pushes at the air where a
    contact change falls between two samples.
    """
    contact, place = _stances(motion.footholds, times, float(motion.times[-1]))
    feet = _interpolated(motion.times, motion.foot_position_W, times)
    feet[..., :2] = np.where(contact[..., None], place, feet[..., :2])
    force = _interpolated(motion.times, motion.foot_force_W, times)
    return Motion(
        times=times,
        base_position_W=_interpolated(motion.times, motion.base_position_W, times),
        base_rpy=_interpolated(motion.times, np.unwrap(motion.base_rpy, axis=0), times),
        base_velocity_W=_interpolated(motion.times, motion.base_velocity_W, times),
        base_angular_velocity_W=_interpolated(motion.times, motion.base_angular_velocity_W, times),
        foot_position_W=feet,
        foot_force_W=np.where(contact[..., None], force, 0.0),
        contact=contact,
        footholds=motion.footholds,
    )


def _interpolated(samples: Array, values: Array, times: Array) -> Array:
    """Values (N, …) known at ``samples`` (N,), at ``times`` (M,): (M, …)."""
    columns = values.reshape(len(samples), -1).T
    rows = [np.interp(times, samples, column) for column in columns]
    return np.stack(rows, axis=-1).reshape(len(times), *values.shape[1:])


def _stances(footholds: Footholds, times: Array, end: float) -> tuple[Flags, Array]:
    """Whether each foot stands (M, 4), and where (M, 4, 2) in m; a change is the later phase's.

    At the motion's ``end`` (s) only those feet stand whose stance lasts until then.
    """
    contact = np.zeros((len(times), N_FEET), dtype=bool)
    place = np.zeros((len(times), N_FEET, 2))
    for foot, position, touchdown, liftoff in zip(
        footholds.foot, footholds.position_W, footholds.touchdown, footholds.liftoff, strict=True
    ):
        lasts = liftoff > end - ROUNDING
        stands = (times >= touchdown) & ((times < liftoff) | lasts)
        contact[stands, foot] = True
        place[stands, foot] = position
    return contact, place
