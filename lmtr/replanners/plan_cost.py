"""What a plan is expected to cost when it is carried out, to choose among several by (Sec. 6).

The paper hopes for "a choice that minimizes … the cost of execution" among modes. Four things are
predicted, each without a unit, so that one set of weights suits any robot and task.
"""

import numpy as np

from lmtr.arrays import Array
from lmtr.geometry.line import signed_distance
from lmtr.geometry.rotation import forward_axis
from lmtr.robot.model import FEET, RobotModel
from lmtr.settings import NonNegative, Positive, Settings
from lmtr.spline import hermite
from lmtr.trajectory.nodes import POSITION, RATE, RPY, SWING_POSITION, SWING_VELOCITY, VALUE
from lmtr.trajectory.trajectory import BASE_STEP, Trajectory
from lmtr.vectors.layout import SEGMENT_NODES, TASK_LAYOUT
from lmtr.vectors.segment_vector import decode_segment


class PlanCost(Settings):
    """Weights of what a plan is judged by, and the scales that make each a number around one.

    Attributes:
        obstacles: Weight of footholds near lines.
        kinematics: Weight of standing feet outside their range of motion.
        jump: Weight of what the plan departs from the present state at its beginning.
        progress: Weight of being slower than the fastest of the plans that are compared.
        clearance: Distance of a new foothold to a line from which it costs nothing (m).
        forward_limit: Half the range of motion, forward of and behind neutral (m).
        excess: Mean excess over it that costs one (m).
        velocity_jump: Jump of the base's velocity that costs one (m/s).
        foot_jump: Mean jump of the feet that costs one (m).
        lag: Way behind the fastest plan that costs one (m).
    """

    obstacles: NonNegative = 1.0
    kinematics: NonNegative = 1.0
    jump: NonNegative = 0.1
    progress: NonNegative = 0.1
    clearance: Positive = 0.15
    forward_limit: Positive = 0.2
    excess: Positive = 0.01
    velocity_jump: Positive = 0.1
    foot_jump: Positive = 0.05
    lag: Positive = 0.1

    def of(self, x: Array, tau: Array, robot: RobotModel) -> Array:
        """Costs of K plans for each of B tasks.

        Args:
            x: Tasks (B, 35), SI units, _S.
            tau: Plans (B, K, 264), SI units, _S.
            robot: Whose range of motion it is.

        Returns:
            (B, K), without a unit; each depends on its own task and plans alone.
        """
        task = {name: part[:, None] for name, part in TASK_LAYOUT.unpack(x).items()}
        feet = np.stack([task[f"{foot}_position"] for foot in FEET], axis=-2)  # (B, 1, 4, 3)
        since = np.stack([task[f"{foot}_time_since_liftoff"] for foot in FEET], axis=-1)
        plan = decode_segment(tau)
        return np.asarray(
            self.obstacles * self._obstacles(plan, task["next_lines"])
            + self.kinematics * self._kinematics(plan, feet, since == 0.0, robot)
            + self.jump * self._jump(plan, task["linear_velocity"], feet)
            + self.progress * self._lag(plan, task["goal_position"])
        )

    def _obstacles(self, plan: Trajectory, lines: Array) -> Array:
        """Σ over new footholds of (1 − d/clearance)², d the distance to the nearest line."""
        new = plan.footholds[..., 1:, :2]  # (B, K, 4, S − 1, 2)
        apart = np.abs(signed_distance(lines[..., None, None, :, :], new[..., None, :]))
        near = np.maximum(1.0 - apart.min(axis=-1) / self.clearance, 0.0)
        return np.asarray((near**2).sum(axis=(-2, -1)))

    def _kinematics(self, plan: Trajectory, feet: Array, stands: Array, robot: RobotModel) -> Array:
        """Mean excess of standing feet over the range of motion; those that stand stay there."""
        # At the base's nodes no spline has to be evaluated. All below is (B, K, nodes, 4).
        times: Array = BASE_STEP * np.arange(1.0, SEGMENT_NODES)[:, None]
        base = plan.base_nodes[..., 1:, VALUE, :]
        axis = forward_axis(base[..., RPY])
        ahead_of_base = (base[..., POSITION] * axis).sum(axis=-1)[..., None]
        first = np.where(stands[..., None], feet, plan.footholds[..., 0, :])
        in_first = times < plan.liftoff_times[..., None, :, 0]
        in_second = times >= plan.touchdown_times[..., None, :, 0]
        excess = np.zeros(in_first.shape)
        for place, there in ((first, in_first), (plan.footholds[..., 1, :], in_second)):
            forward = _along(axis, place) - ahead_of_base
            beyond = np.abs(forward - robot.nominal_feet_B[:, 0]) - self.forward_limit
            excess += np.where(there, np.maximum(beyond, 0.0), 0.0)
        contacts = np.maximum((in_first | in_second).sum(axis=(-2, -1)), 1)
        return np.asarray(excess.sum(axis=(-2, -1)) / contacts / self.excess)

    def _jump(self, plan: Trajectory, velocity: Array, feet: Array) -> Array:
        """Jumps of the base's velocity and of the feet where the plan begins."""
        of_base = _norm(plan.base_nodes[..., 0, RATE, POSITION] - velocity)
        of_feet = _norm(feet_at_epoch(plan) - feet).mean(axis=-1)
        return np.asarray(of_base / self.velocity_jump + of_feet / self.foot_jump)

    def _lag(self, plan: Trajectory, goal: Array) -> Array:
        """Way towards the goal that the fastest plan is ahead at the end."""
        direction = goal / np.maximum(np.linalg.norm(goal, axis=-1, keepdims=True), 1e-9)
        moved = plan.base_nodes[..., -1, 0, :2] - plan.base_nodes[..., 0, 0, :2]
        way = (moved * direction).sum(axis=-1)
        return np.asarray((way.max(axis=-1, keepdims=True) - way) / self.lag)


def feet_at_epoch(plan: Trajectory) -> Array:
    """Where the feet of segments (...) are at time 0, (..., 4, 3) in m.

    That of :func:`~lmtr.trajectory.sample.sample_feet`, which evaluates forces and velocities too.
    """
    liftoff, touchdown = plan.liftoff_times[..., 0], plan.touchdown_times[..., 0]
    first, second = plan.footholds[..., 0, :], plan.footholds[..., 1, :]
    middle = plan.swing_nodes[..., 0, SWING_POSITION]
    rate = np.zeros_like(middle)
    rate[..., :2] = plan.swing_nodes[..., 0, SWING_VELOCITY]
    half = np.maximum(touchdown - liftoff, 1e-9) / 2.0  # a swing is two cubics of half its duration
    local = np.clip(-liftoff / half, 0.0, 2.0)
    descends = local >= 1.0
    u, down = (local - descends)[..., None], descends[..., None]
    swing = hermite.value(
        u,
        np.where(down, middle, first),
        np.where(down, rate, 0.0),
        np.where(down, second, middle),
        np.where(down, 0.0, rate),
        half[..., None],
    )
    stays, lands = (liftoff > 0.0)[..., None], (touchdown <= 0.0)[..., None]
    return np.where(stays, first, np.where(lands, second, swing))


def _along(axis: Array, place: Array) -> Array:
    """Places (..., 4, 3) along axes (..., M, 3), (..., M, 4)."""
    axis, place = axis[..., :, None, :], place[..., None, :, :]
    return np.asarray(
        axis[..., 0] * place[..., 0] + axis[..., 1] * place[..., 1] + axis[..., 2] * place[..., 2]
    )


def _norm(vectors: Array) -> Array:
    return np.asarray(np.sqrt((vectors**2).sum(axis=-1)))
