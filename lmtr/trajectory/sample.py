"""Evaluation of a trajectory's splines at given times, by explicit look-up of node and phase."""

from dataclasses import dataclass

import numpy as np

from lmtr.arrays import Array, Flags, Indices
from lmtr.geometry.rotation import angular_velocity_W
from lmtr.robot.model import N_FEET
from lmtr.spline import hermite
from lmtr.trajectory.nodes import POSITION, RATE, RPY, SWING_POSITION, SWING_VELOCITY, VALUE
from lmtr.trajectory.trajectory import BASE_STEP, FORCE_PIECES, Trajectory


@dataclass(frozen=True)
class BaseSamples:
    """Base motion at M times, arrays (..., M, 3): SI units, frame of the trajectory."""

    position: Array
    rpy: Array
    velocity: Array
    rpy_rate: Array
    acceleration: Array
    rpy_acceleration: Array

    @property
    def angular_velocity(self) -> Array:
        """Angular velocity ω in the trajectory's frame, (..., M, 3) in rad/s."""
        return angular_velocity_W(self.rpy, self.rpy_rate)


@dataclass(frozen=True)
class FootSamples:
    """Foot motion at M times, in the frame of the trajectory.

    Attributes:
        position: (..., M, 4, 3) in m.
        velocity: (..., M, 4, 3) in m/s, zero in stance.
        force: Ground reaction (..., M, 4, 3) in N, zero in swing.
        contact: Whether the foot stands, (..., M, 4); a contact change belongs to the later phase.
        time_since_liftoff: Seconds since the current swing began, 0 in stance, (..., M, 4).
        stance: Index of the current stance, or in swing of the one before it, (..., M, 4).
    """

    position: Array
    velocity: Array
    force: Array
    contact: Flags
    time_since_liftoff: Array
    stance: Indices


def sample_base(trajectory: Trajectory, times: Array) -> BaseSamples:
    """Base motion at ``times`` (..., M) in s; outside the base nodes the end polynomials go on."""
    nodes = trajectory.base_nodes
    local = (times - trajectory.base_start[..., None]) / BASE_STEP
    # An epoch on a knot belongs to the polynomial that begins there, despite rounding.
    index = np.clip(np.floor(local + 1e-9).astype(np.intp), 0, nodes.shape[-3] - 2)
    u = (local - index)[..., None]
    first = np.take_along_axis(nodes, index[..., None, None], axis=-3)
    last = np.take_along_axis(nodes, index[..., None, None] + 1, axis=-3)
    ends = (first[..., VALUE, :], first[..., RATE, :], last[..., VALUE, :], last[..., RATE, :])
    value = hermite.value(u, *ends, BASE_STEP)
    velocity = hermite.first_derivative(u, *ends, BASE_STEP)
    acceleration = hermite.second_derivative(u, *ends, BASE_STEP)
    return BaseSamples(
        position=value[..., POSITION],
        rpy=value[..., RPY],
        velocity=velocity[..., POSITION],
        rpy_rate=velocity[..., RPY],
        acceleration=acceleration[..., POSITION],
        rpy_acceleration=acceleration[..., RPY],
    )


def sample_feet(trajectory: Trajectory, times: Array) -> FootSamples:
    """Foot motion, forces and contacts at ``times`` (..., M) in s.

    Before the first stance begins a foot stands in it; after the last one ended it stays there.
    """
    changes = trajectory.contact_times[..., 1:-1]  # (..., 4, 2S − 2): lift-offs and touch-downs
    t = np.broadcast_to(
        times[..., None, :], (*trajectory.batch_shape, N_FEET, times.shape[-1])
    )  # (..., 4, M)
    phase = (t[..., None] >= changes[..., None, :]).sum(axis=-1)  # (..., 4, M), 0 … 2S − 2
    contact = phase % 2 == 0
    stance = phase // 2
    position, velocity = _foot_motion(trajectory, t, stance, contact)
    begin = _pick(trajectory.contact_times, phase)
    return FootSamples(
        position=np.moveaxis(position, -3, -2),
        velocity=np.moveaxis(velocity, -3, -2),
        force=np.moveaxis(_force(trajectory, t, stance, contact), -3, -2),
        contact=np.moveaxis(contact, -2, -1),
        time_since_liftoff=np.moveaxis(np.where(contact, 0.0, t - begin), -2, -1),
        stance=np.moveaxis(stance, -2, -1),
    )


def _pick(array: Array, index: Indices) -> Array:
    """Entries of array (..., 4, L, *rest) at index (..., 4, M): (..., 4, M, *rest)."""
    axis = index.ndim - 1
    return np.take_along_axis(
        array, index.reshape((*index.shape, *([1] * (array.ndim - index.ndim)))), axis=axis
    )


def _foot_motion(
    trajectory: Trajectory, t: Array, stance: Indices, contact: Flags
) -> tuple[Array, Array]:
    """Position (m) and velocity (m/s) of the feet, (..., 4, M, 3) each."""
    here = _pick(trajectory.footholds, stance)
    if trajectory.n_stances == 1:
        return here, np.zeros_like(here)
    swing = np.minimum(stance, trajectory.n_stances - 2)
    there = _pick(trajectory.footholds, swing + 1)
    node = _pick(trajectory.swing_nodes, swing)
    liftoff, touchdown = (_pick(trajectory.contact_times, 2 * swing + k) for k in (1, 2))
    half = np.maximum(touchdown - liftoff, 1e-9)[..., None] / 2.0
    u = np.clip((t - liftoff)[..., None] / half, 0.0, 2.0)
    middle = node[..., SWING_POSITION]
    middle_velocity = np.concatenate(
        [node[..., SWING_VELOCITY], np.zeros_like(node[..., :1])], axis=-1
    )
    rising = u < 1.0
    ends = (
        np.where(rising, here, middle),
        np.where(rising, 0.0, middle_velocity),
        np.where(rising, middle, there),
        np.where(rising, middle_velocity, 0.0),
    )
    u = np.where(rising, u, u - 1.0)
    stands = contact[..., None]
    position = np.where(stands, here, hermite.value(u, *ends, half))
    velocity = np.where(stands, 0.0, hermite.first_derivative(u, *ends, half))
    return position, velocity


def _force(trajectory: Trajectory, t: Array, stance: Indices, contact: Flags) -> Array:
    """Contact forces (N), (..., 4, M, 3)."""
    begin, end = (_pick(trajectory.contact_times, 2 * stance + k) for k in (0, 1))
    duration = np.maximum(end - begin, 1e-9)
    local = np.clip((t - begin) / duration, 0.0, 1.0) * FORCE_PIECES
    piece = np.minimum(local.astype(np.intp), FORCE_PIECES - 1)
    nodes = _pick(trajectory.force_nodes, stance)  # (..., 4, M, K + 1, 2, 3)
    first = np.take_along_axis(nodes, piece[..., None, None, None], axis=-3)[..., 0, :, :]
    last = np.take_along_axis(nodes, piece[..., None, None, None] + 1, axis=-3)[..., 0, :, :]
    force = hermite.value(
        (local - piece)[..., None],
        first[..., VALUE, :],
        first[..., RATE, :],
        last[..., VALUE, :],
        last[..., RATE, :],
        (duration / FORCE_PIECES)[..., None],
    )
    return np.where(contact[..., None], force, 0.0)
