"""Evaluation of a trajectory's splines at given times, by explicit look-up of node and phase.

The coefficients of each cubic are worked out once and looked up for all its samples. In memory
the samples of a component lie next to each other, since arithmetic is fast on long rows and slow
on triples; records show them with the axes turned.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lmtr.arrays import Array, Flags, Indices
from lmtr.geometry.rotation import angular_velocity_W
from lmtr.robot.model import N_FEET
from lmtr.spline import hermite
from lmtr.trajectory.nodes import POSITION, RATE, RPY, SWING_POSITION, SWING_VELOCITY, VALUE
from lmtr.trajectory.trajectory import BASE_STEP, FORCE_PIECES, Trajectory

_PLACE, _FORCE = slice(0, 3), slice(3, 6)
"""Components of a foot's nodes: its position (m), and the force on it (N)."""


@dataclass(frozen=True)
class BaseSamples:
    """Base motion at M times, in the frame of the trajectory; evaluated as far as it is read.

    Attributes:
        u: Local time in the polynomial of each sample, (..., M).
        cubics: Coefficients of that polynomial, (4, 6, ..., M).
    """

    u: Array
    cubics: Array

    @property
    def position(self) -> Array:
        """Position (..., M, 3) in m."""
        return self._value[..., POSITION]

    @property
    def rpy(self) -> Array:
        """Roll, pitch, yaw (..., M, 3) in rad."""
        return self._value[..., RPY]

    @property
    def velocity(self) -> Array:
        """Velocity (..., M, 3) in m/s."""
        return self._slope[..., POSITION]

    @property
    def rpy_rate(self) -> Array:
        """Time derivative of roll, pitch, yaw (..., M, 3) in rad/s."""
        return self._slope[..., RPY]

    @property
    def acceleration(self) -> Array:
        """Acceleration (..., M, 3) in m/s²."""
        return self._curvature[..., POSITION]

    @property
    def rpy_acceleration(self) -> Array:
        """Second time derivative of roll, pitch, yaw (..., M, 3) in rad/s²."""
        return self._curvature[..., RPY]

    @property
    def angular_velocity(self) -> Array:
        """Angular velocity ω in the trajectory's frame, (..., M, 3) in rad/s."""
        return angular_velocity_W(self.rpy, self.rpy_rate)

    @cached_property
    def _value(self) -> Array:
        return np.moveaxis(hermite.cubic_value(self.u, self.cubics), 0, -1)

    @cached_property
    def _slope(self) -> Array:
        return np.moveaxis(hermite.cubic_slope(self.u, self.cubics, BASE_STEP), 0, -1)

    @cached_property
    def _curvature(self) -> Array:
        return np.moveaxis(hermite.cubic_curvature(self.u, self.cubics, BASE_STEP), 0, -1)


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
    nodes = np.moveaxis(trajectory.base_nodes, (-2, -1), (0, 1))  # (2, 6, ..., N)
    times = np.broadcast_to(times, (*trajectory.batch_shape, times.shape[-1]))
    local = (times - trajectory.base_start[..., None]) / BASE_STEP
    # An epoch on a knot belongs to the polynomial that begins there, despite rounding.
    index = np.clip(np.floor(local + 1e-9).astype(np.intp), 0, nodes.shape[-1] - 2)
    return BaseSamples(local - index, _cubics(nodes[..., :-1], nodes[..., 1:], BASE_STEP, index))


def sample_feet(trajectory: Trajectory, times: Array) -> FootSamples:
    """Foot motion, forces and contacts at ``times`` (..., M) in s.

    Before the first stance begins a foot stands in it; after the last one ended it stays there.
    """
    return sample_each_foot(trajectory, times[..., None, :])


def sample_each_foot(trajectory: Trajectory, times: Array) -> FootSamples:
    """Like :func:`sample_feet`, at times of its own for each foot, (..., 4, M) in s."""
    times = np.broadcast_to(times, (*trajectory.batch_shape, N_FEET, times.shape[-1]))
    changes = trajectory.contact_times[..., 1:-1, None]  # lift-offs and touch-downs of each foot
    phase = (times[..., None, :] >= changes).sum(axis=-2)  # (..., 4, M), 0 … 2S − 2
    contact = phase % 2 == 0
    begins = trajectory.contact_times[..., :-1]
    durations = np.maximum(np.diff(trajectory.contact_times, axis=-1), 1e-9)
    begin, duration = _looked_up(np.stack([begins, durations]), phase)
    since = times - begin
    # Each phase is two cubics of half its duration: a stance in its forces, a swing in its place.
    local = FORCE_PIECES * np.clip(since / duration, 0.0, 1.0)
    second = local >= 1.0
    u = local - second
    nodes = _foot_nodes(trajectory)
    # Halves of all phases of a foot in a row.
    first, last = _in_a_row(nodes[..., :-1]), _in_a_row(nodes[..., 1:])
    each = np.repeat(durations / FORCE_PIECES, FORCE_PIECES, axis=-1)
    cubics = _cubics(first, last, each, FORCE_PIECES * phase + second)
    value = _by_time(hermite.cubic_value(u, cubics))
    velocity = hermite.cubic_slope(u, cubics[:, _PLACE], duration / FORCE_PIECES)
    return FootSamples(
        position=value[..., _PLACE],
        velocity=_by_time(velocity),
        force=value[..., _FORCE],
        contact=contact.swapaxes(-2, -1),
        time_since_liftoff=np.where(contact, 0.0, since).swapaxes(-2, -1),
        stance=(phase // 2).swapaxes(-2, -1),
    )


def _foot_nodes(trajectory: Trajectory) -> Array:
    """Nodes of place and force, (2, 6, ..., 4, 2S − 1, 3): start, middle and end of each phase.

    In stance the place stays, in swing the force is zero.
    """
    phases = 2 * trajectory.n_stances - 1
    nodes = np.zeros((2, 6, *trajectory.batch_shape, N_FEET, phases, FORCE_PIECES + 1))
    stances, swings = nodes[..., 0::2, :], nodes[..., 1::2, :]
    place = np.moveaxis(trajectory.footholds, -1, 0)
    middle = np.moveaxis(trajectory.swing_nodes, -1, 0)
    stances[VALUE, _PLACE] = place[..., None]
    stances[:, _FORCE] = np.moveaxis(trajectory.force_nodes, (-2, -1), (0, 1))
    swings[VALUE, _PLACE, ..., 0] = place[..., :-1]
    swings[VALUE, _PLACE, ..., 1] = middle[SWING_POSITION]
    swings[RATE, :2, ..., 1] = middle[SWING_VELOCITY]
    swings[VALUE, _PLACE, ..., 2] = place[..., 1:]
    return nodes


def _cubics(first: Array, last: Array, duration: Array | float, index: Indices) -> Array:
    """Coefficients (4, C, ..., M) of cubics in local time.

    Args:
        first: Nodes at which the cubics begin, (2, C, ..., K).
        last: Nodes at which they end, (2, C, ..., K).
        duration: Their durations (..., K) in s, or one for all.
        index: Which cubics, (..., M).
    """
    many = index.shape[-1] >= first.shape[-1]
    if not many:  # only the cubics that are needed
        first, last = _looked_up(first, index), _looked_up(last, index)
        duration = _looked_up(duration, index) if isinstance(duration, np.ndarray) else duration
    found = np.stack(hermite.cubic(first[VALUE], first[RATE], last[VALUE], last[RATE], duration))
    return _looked_up(found, index) if many else found


def _in_a_row(array: Array) -> Array:
    """The last two axes as one."""
    return array.reshape((*array.shape[:-2], array.shape[-2] * array.shape[-1]))


def _looked_up(table: Array, index: Indices) -> Array:
    """Entries at index (..., M) of the last axis of a table (*C, ..., P), giving (*C, ..., M)."""
    owners, length = index.shape[:-1], table.shape[-1]
    begin = length * np.arange(math.prod(owners)).reshape((*owners, 1))
    components = table.shape[: table.ndim - index.ndim]
    return np.asarray(table.reshape((*components, -1)).take(begin + index, axis=-1))


def _by_time(array: Array) -> Array:
    """Samples (C, ..., 4, M) as (..., M, 4, C)."""
    return np.moveaxis(array, 0, -1).swapaxes(-3, -2)
