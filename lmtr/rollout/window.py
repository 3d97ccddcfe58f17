"""Motion during one replanning window: the plan's base, and feet anchored in the world (Sec. 5.1).

The base moves as planned. A foot that touches down stays where it did until it lifts off, whatever
footholds later plans name. A swinging foot starts from where it really is: its distance from the
planned swing at that moment fades out smoothly until touch-down, so that it lands on the planned
foothold and never jumps.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from lmtr.arrays import Array, Flags
from lmtr.geometry.se2 import SE2
from lmtr.rollout.contacts import ContactSchedule, Feet, schedule
from lmtr.rollout.settings import RolloutSettings
from lmtr.trajectory.sample import BaseSamples, sample_base, sample_feet
from lmtr.trajectory.trajectory import BASE_STEP, Trajectory
from lmtr.vectors.state import RobotState


@dataclass(frozen=True)
class Samples:
    """Motion of n rollouts at S times each, in the world frame; fields as in ``Motion``.

    Attributes:
        base_position_W: (n, S, 3) in m.
        base_rpy: Roll, pitch, yaw, (n, S, 3) in rad.
        base_velocity_W: (n, S, 3) in m/s.
        base_angular_velocity_W: (n, S, 3) in rad/s.
        foot_position_W: (n, S, 4, 3) in m.
        foot_force_W: The planned forces, zero unless the foot really stands, (n, S, 4, 3) in N.
        contact: Whether the foot really stands, (n, S, 4).
    """

    base_position_W: Array
    base_rpy: Array
    base_velocity_W: Array
    base_angular_velocity_W: Array
    foot_position_W: Array
    foot_force_W: Array
    contact: Flags


@dataclass(frozen=True)
class Instant:
    """The accumulated motion of n robots at one time.

    Attributes:
        state: χ, from which the next plan is made.
        velocity_W: Base velocity, (n, 3) in m/s.
        feet: Contacts and positions of the feet.
    """

    state: RobotState
    velocity_W: Array
    feet: Feet

    @classmethod
    def at_end(cls, samples: Samples, time_since_liftoff: Array) -> Self:
        """At the last of these samples; ``time_since_liftoff`` (n, 4) in s is the feet's there."""
        position, rpy = samples.base_position_W[:, -1], samples.base_rpy[:, -1]
        velocity = samples.base_velocity_W[:, -1]
        feet = Feet(samples.contact[:, -1], samples.foot_position_W[:, -1], time_since_liftoff)
        frame = SE2(position[:, 0], position[:, 1], rpy[:, 2])
        inner = frame.invert()
        state = RobotState(
            frame_W=frame,
            height=position[:, 2],
            roll_pitch=rpy[:, :2],
            linear_velocity_S=inner.rotate(velocity),
            angular_velocity_S=inner.rotate(samples.base_angular_velocity_W[:, -1]),
            feet_S=inner.over(1).apply(feet.position_W),
            time_since_liftoff=time_since_liftoff,
        )
        return cls(state, velocity, feet)


@dataclass(frozen=True)
class Window:
    """What n rollouts did in one window, in the world frame.

    Attributes:
        samples: At the base nodes from the window's start to its end; the last one belongs to the
            next plan, unless there is none.
        footholds_W: The plan's two footholds on the ground, (n, 4, 2, 3) in m.
        changes: When feet landed on them or lifted off.
        velocity_jump: Between the base's velocity so far and in the plan, (n,) in m/s.
        foot_jump: Between the feet so far and in the plan, (n, 4) in m.
        end: The accumulated motion at the window's end.
    """

    samples: Samples
    footholds_W: Array
    changes: ContactSchedule
    velocity_jump: Array
    foot_jump: Array
    end: Instant


def begin(start: Trajectory) -> tuple[Samples, Instant]:
    """The state at the epoch of segments (n), put into the world as they are given."""
    start = _on_the_ground(start)
    times: Array = np.zeros((*start.batch_shape, 1))
    base, feet = sample_base(start, times), sample_feet(start, times)
    samples = _samples(base, feet.position, feet.contact, feet.force)
    return samples, Instant.at_end(samples, feet.time_since_liftoff[:, -1])


def carry_out(plan_S: Trajectory, before: Instant, settings: RolloutSettings) -> Window:
    """Carry out the first Δt of plans (n), given in the segment frames of ``before``."""
    plan = _on_the_ground(plan_S.moved(before.state.frame_W))
    step_times: Array = BASE_STEP * np.arange(settings.steps_per_cycle + 1.0)
    times = np.broadcast_to(step_times, (*plan.batch_shape, len(step_times)))
    base, planned = sample_base(plan, times), sample_feet(plan, times)
    changes = schedule(plan, before.feet, settings.landing_time, settings.period)
    position, contact = _foot_motion(planned.position, plan, before.feet, changes, step_times)
    samples = _samples(base, position, contact, planned.force)
    since = np.where(
        changes.liftoff <= settings.period,
        settings.period - changes.liftoff,
        before.feet.time_since_liftoff + settings.period,
    )
    return Window(
        samples=samples,
        footholds_W=plan.footholds,
        changes=changes,
        velocity_jump=_norm(base.velocity[:, 0] - before.velocity_W),
        foot_jump=_norm(planned.position[:, 0] - before.feet.position_W),
        end=Instant.at_end(samples, np.where(contact[:, -1], 0.0, since)),
    )


def _norm(vectors: Array) -> Array:
    return np.asarray(np.sqrt((vectors**2).sum(axis=-1)))


def _samples(base: BaseSamples, foot_position: Array, contact: Flags, force: Array) -> Samples:
    return Samples(
        base_position_W=base.position,
        base_rpy=base.rpy,
        base_velocity_W=base.velocity,
        base_angular_velocity_W=base.angular_velocity,
        foot_position_W=foot_position,
        foot_force_W=np.where(contact[..., None], force, 0.0),
        contact=contact,
    )


def _on_the_ground(plan: Trajectory) -> Trajectory:
    """The plan with its footholds at z = 0, which a regressor misses by millimetres."""
    footholds = np.array(plan.footholds)
    footholds[..., 2] = 0.0
    return replace(plan, footholds=footholds)


def _foot_motion(
    planned: Array, plan: Trajectory, feet: Feet, changes: ContactSchedule, times: Array
) -> tuple[Array, Flags]:
    """Real positions (n, S + 1, 4, 3) and contacts (n, S + 1, 4) beside the planned positions."""
    t = times[None, :, None]
    landing, liftoff, touchdown = (
        time[:, None, :] for time in (changes.landing, changes.liftoff, changes.touchdown)
    )
    first, second = (plan.footholds[:, None, :, k] for k in range(2))
    here = feet.position_W[:, None]
    landed, lifted, touched = t >= landing, t >= liftoff, t >= touchdown
    contact = ((feet.stands[:, None] | landed) & ~lifted) | touched
    anchor = np.where(np.isfinite(landing)[..., None], first, here)
    place = np.where(touched[..., None], second, np.where(landed[..., None], anchor, here))

    # The swing under way at t: where and when it began in reality and in the plan.
    begin = np.where(lifted, liftoff, 0.0)
    end = np.where(lifted, touchdown, np.minimum(landing, touchdown))
    began_at = np.where(lifted[..., None], anchor, here)
    as_planned = (lifted & (liftoff > 0.0))[..., None]
    plan_began_at = np.where(as_planned, first, planned[:, :1])
    progress = np.where(contact, 0.0, t - begin) / np.where(contact, 1.0, end - begin)
    fading = 1.0 - progress**2 * (3.0 - 2.0 * progress)
    swing = planned + fading[..., None] * (began_at - plan_began_at)
    swing[..., 2] = np.maximum(swing[..., 2], 0.0)
    return np.where(contact[..., None], place, swing), contact
