"""The robot's state χ at one instant, in the segment frame (Sec. 4.1, 4.3)."""

from dataclasses import dataclass

import numpy as np

from lmtr.arrays import Array
from lmtr.geometry.se2 import SE2
from lmtr.trajectory.sample import BaseSamples, sample_base, sample_feet
from lmtr.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class RobotState:
    """χ, batched over leading axes ``...``.

    All but the frame is given in the segment frame _S, so it does not change when the robot is
    put elsewhere in the world.

    Attributes:
        frame_W: The segment frame _S: under the base, x along its yaw; (...).
        height: Height of the base (m), (...).
        roll_pitch: Roll and pitch (rad), (..., 2).
        linear_velocity_S: Velocity of the base (m/s), (..., 3).
        angular_velocity_S: Angular velocity of the base (rad/s), (..., 3).
        feet_S: Foot positions (m), (..., 4, 3).
        time_since_liftoff: Seconds that each foot has been swinging, 0 in stance, (..., 4).
    """

    frame_W: SE2
    height: Array
    roll_pitch: Array
    linear_velocity_S: Array
    angular_velocity_S: Array
    feet_S: Array
    time_since_liftoff: Array


def segment_frame(base: BaseSamples) -> SE2:
    """The segment frames _S at base samples, in the frame of their trajectory."""
    return SE2(base.position[..., 0], base.position[..., 1], base.rpy[..., 2])


def state_at(trajectory: Trajectory, epoch: Array | float) -> RobotState:
    """χ of a trajectory, given in the world frame, at one or several epochs.

    Args:
        trajectory: With batch axes (...).
        epoch: A time for all (float), one each (...), or M each (..., M), in s.

    Returns:
        The state, batched like the epochs.
    """
    batch = trajectory.batch_shape
    epochs = np.asarray(epoch, dtype=float)
    if epochs.ndim == 0:
        epochs = np.broadcast_to(epochs, batch)
    times = epochs.reshape((*batch, -1))
    base, feet = sample_base(trajectory, times), sample_feet(trajectory, times)
    frame = segment_frame(base)
    inner = frame.invert()
    position_S = inner.over(1).apply(feet.position)

    def shaped(array: Array) -> Array:
        return array.reshape((*epochs.shape, *array.shape[times.ndim :]))

    return RobotState(
        frame_W=SE2(shaped(frame.x), shaped(frame.y), shaped(frame.yaw)),
        height=shaped(base.position[..., 2]),
        roll_pitch=shaped(base.rpy[..., :2]),
        linear_velocity_S=shaped(inner.rotate(base.velocity)),
        angular_velocity_S=shaped(inner.rotate(base.angular_velocity)),
        feet_S=shaped(position_S),
        time_since_liftoff=shaped(feet.time_since_liftoff),
    )
