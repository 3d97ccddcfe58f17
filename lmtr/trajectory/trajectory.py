"""A locomotion trajectory τ in its native nodes: base spline, phases, foot motion, forces.

One type serves the expert's long solutions (7 stances and 6 swings per leg over 7.5 s), the
segments cut from them (2 stances and 1 swing, 0.8 s) and what a network predicts; the lengths of
the axes are the paper's scope s (Eq. 1). All arrays may carry the same leading batch axes ``...``.
"""

from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.geometry.se2 import SE2
from lmtr.robot.model import N_FEET
from lmtr.trajectory.nodes import POSITION, RATE, SWING_POSITION, SWING_VELOCITY, VALUE, YAW

BASE_STEP = 0.1
"""Spacing of base nodes (s), Sec. 4.1."""

FORCE_PIECES = 2
"""Cubic force polynomials per stance; with two of them dim(τ) is the paper's 264.

Two by construction: a stance has one node between its ends, and the expert's force points
(:mod:`lmtr.expert.stances`) and gating are written for it.
"""


@dataclass(frozen=True)
class Trajectory:
    """Splines of base and feet in a frame with z up and the ground at z = 0.

    Attributes:
        base_start: Time of the first base node, (...) in s.
        base_nodes: Values and time derivatives of x, y, z (m) and roll, pitch, yaw (rad) every
            ``BASE_STEP``, (..., N, 2, 6).
        contact_times: Per foot, the start of the first stance, then lift-off and touch-down of
            each swing, then the end of the last stance, (..., 4, 2·S) in s, ascending.
        footholds: Position of each stance, (..., 4, S, 3) in m.
        swing_nodes: The node in the middle of each swing: position x, y, z (m) and horizontal
            velocity x, y (m/s); its vertical velocity is zero. (..., 4, S − 1, 5).
        force_nodes: Contact force (N) and its time derivative (N/s) at the ends of the
            ``FORCE_PIECES`` equal parts of each stance, (..., 4, S, FORCE_PIECES + 1, 2, 3).
            Nodes shared with a swing are zero.
    """

    base_start: Array
    base_nodes: Array
    contact_times: Array
    footholds: Array
    swing_nodes: Array
    force_nodes: Array

    def __post_init__(self) -> None:
        stances = self.footholds.shape[-2]
        batch = self.base_nodes.shape[:-3]
        expected = {
            "base_start": batch,
            "base_nodes": (*batch, self.base_nodes.shape[-3], 2, 6),
            "contact_times": (*batch, N_FEET, 2 * stances),
            "footholds": (*batch, N_FEET, stances, 3),
            "swing_nodes": (*batch, N_FEET, stances - 1, 5),
            "force_nodes": (*batch, N_FEET, stances, FORCE_PIECES + 1, 2, 3),
        }
        for name, shape in expected.items():
            found = np.shape(getattr(self, name))
            if found != shape:
                raise DataError(
                    f"trajectory: {name} must have shape {shape} beside base nodes "
                    f"{self.base_nodes.shape} and {stances} stances, got {found}"
                )

    @property
    def batch_shape(self) -> tuple[int, ...]:
        """Leading batch axes."""
        return self.base_nodes.shape[:-3]

    @property
    def n_stances(self) -> int:
        """Stances per foot, S; there is one swing fewer."""
        return int(self.footholds.shape[-2])

    @property
    def base_end(self) -> Array:
        """Time of the last base node, (...) in s."""
        return np.asarray(self.base_start + BASE_STEP * (self.base_nodes.shape[-3] - 1))

    @property
    def liftoff_times(self) -> Array:
        """Lift-off of each swing, (..., 4, S − 1) in s."""
        return self.contact_times[..., 1:-1:2]

    @property
    def touchdown_times(self) -> Array:
        """Touch-down of each swing, (..., 4, S − 1) in s."""
        return self.contact_times[..., 2::2]

    def __getitem__(self, index: object) -> "Trajectory":
        """Select along the batch axes, as NumPy indexing does."""
        return Trajectory(**{f.name: getattr(self, f.name)[index] for f in fields(self)})

    def seen_from(self, frame: SE2, epoch: Array | float = 0.0) -> "Trajectory":
        """This trajectory in the coordinates of ``frame`` and with time counted from ``epoch``.

        Args:
            frame: Frame (...) given in the coordinates of this trajectory.
            epoch: Its time zero, (...) in s.
        """
        return self.moved(frame.invert(), -np.asarray(epoch, dtype=float))

    def moved(self, frame: SE2, delay: Array | float = 0.0) -> "Trajectory":
        """This trajectory, given in ``frame``, seen from outside and delayed by ``delay`` (s)."""
        delay = np.broadcast_to(np.asarray(delay, dtype=float), self.batch_shape)
        base = np.array(self.base_nodes)
        base[..., VALUE, POSITION] = frame.over(1).apply(base[..., VALUE, POSITION])
        base[..., RATE, POSITION] = frame.over(1).rotate(base[..., RATE, POSITION])
        base[..., VALUE, YAW] += np.asarray(frame.yaw)[..., None]
        swing = np.array(self.swing_nodes)
        swing[..., SWING_POSITION] = frame.over(2).apply(swing[..., SWING_POSITION])
        swing[..., SWING_VELOCITY] = frame.over(2).rotate(swing[..., SWING_VELOCITY])
        return replace(
            self,
            base_start=self.base_start + delay,
            base_nodes=base,
            contact_times=self.contact_times + delay[..., None, None],
            footholds=frame.over(2).apply(self.footholds),
            swing_nodes=swing,
            force_nodes=frame.over(4).rotate(self.force_nodes),
        )

    @classmethod
    def stack(cls, trajectories: "list[Trajectory]") -> Self:
        """One batch from trajectories of equal shapes, along a new first axis."""
        return cls(
            **{
                f.name: np.stack([getattr(trajectory, f.name) for trajectory in trajectories])
                for f in fields(cls)
            }
        )

    def is_finite(self) -> Array:
        """Whether every number of each batch element is finite, (...) bool."""
        finite = np.ones(self.batch_shape, dtype=bool)
        for field in fields(self):
            array = np.isfinite(getattr(self, field.name))
            finite &= array.reshape((*self.batch_shape, -1)).all(axis=-1)
        return finite
