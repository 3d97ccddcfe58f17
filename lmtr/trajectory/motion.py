"""Sampled motion: the one record that exports, metrics and figures read.

An expert solution, a segment and a rollout all become a :class:`Motion`, so that everything drawn
or exported treats them alike.
"""

from dataclasses import dataclass

import numpy as np

from lmtr.arrays import Array, Flags, Indices
from lmtr.robot.model import N_FEET
from lmtr.trajectory.sample import sample_base, sample_feet
from lmtr.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class Footholds:
    """The footholds of one motion, K of them, by foot and then by time.

    Attributes:
        foot: Index of the foot in LF, RF, LH, RH, (K,).
        position_W: x, y on the ground, (K, 2) in m.
        touchdown: Start of the stance, (K,) in s; that of the first stance is the motion's start.
        liftoff: End of the stance, (K,) in s; that of the last stance is the motion's end, unless
            the foot swings there.
    """

    foot: Indices
    position_W: Array
    touchdown: Array
    liftoff: Array


@dataclass(frozen=True)
class Motion:
    """One motion at M sample times, in the world frame, SI units.

    Attributes:
        times: (M,) in s.
        base_position_W: (M, 3) in m.
        base_rpy: Roll, pitch, yaw, (M, 3) in rad.
        base_velocity_W: (M, 3) in m/s.
        base_angular_velocity_W: (M, 3) in rad/s.
        foot_position_W: (M, 4, 3) in m.
        foot_force_W: Ground reactions, (M, 4, 3) in N; zero in swing.
        contact: (M, 4); a sample at a contact change belongs to the later phase.
        footholds: Where and when the feet stood.
    """

    times: Array
    base_position_W: Array
    base_rpy: Array
    base_velocity_W: Array
    base_angular_velocity_W: Array
    foot_position_W: Array
    foot_force_W: Array
    contact: Flags
    footholds: Footholds


def sampled(trajectory: Trajectory, dt: float) -> Motion:
    """Sample one trajectory (no batch axes), given in the world frame, every ``dt`` seconds.

    The last base node's time is always among the samples.
    """
    start, end = float(trajectory.base_start), float(trajectory.base_end)
    count = int(np.floor((end - start) / dt + 1e-9)) + 1
    times: Array = start + dt * np.arange(count, dtype=np.float64)
    if end - times[-1] > 1e-9:
        times = np.concatenate([times, np.array([end])])
    base, feet = sample_base(trajectory, times), sample_feet(trajectory, times)
    return Motion(
        times=times,
        base_position_W=base.position,
        base_rpy=base.rpy,
        base_velocity_W=base.velocity,
        base_angular_velocity_W=base.angular_velocity,
        foot_position_W=feet.position,
        foot_force_W=feet.force,
        contact=feet.contact,
        footholds=_footholds(trajectory),
    )


def _footholds(trajectory: Trajectory) -> Footholds:
    return Footholds(
        foot=np.repeat(np.arange(N_FEET), trajectory.n_stances),
        position_W=trajectory.footholds[..., :2].reshape(-1, 2),
        touchdown=trajectory.contact_times[:, 0::2].reshape(-1),
        liftoff=trajectory.contact_times[:, 1::2].reshape(-1),
    )
