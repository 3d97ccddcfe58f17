"""Accumulation of replanning windows into motions and records (Sec. 5.1)."""

from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from lmtr.arrays import Array, Flags, Indices
from lmtr.robot.model import N_FEET
from lmtr.rollout.contacts import Feet
from lmtr.rollout.courses import Course
from lmtr.rollout.record import Ending, Rollout
from lmtr.rollout.settings import RolloutSettings
from lmtr.rollout.window import Samples, Window
from lmtr.trajectory.motion import Footholds, Motion
from lmtr.trajectory.trajectory import BASE_STEP

SAMPLED = tuple(f.name for f in fields(Samples))
"""Fields that samples and motions share."""


@dataclass
class _ContactChanges:
    """Touch-downs or lift-offs in the order in which windows brought them."""

    rows: list[Indices] = field(default_factory=list)
    feet: list[Indices] = field(default_factory=list)
    times: list[Array] = field(default_factory=list)

    def add(self, rows: Indices, happens: Flags, times: Array) -> tuple[Indices, Indices]:
        """Note the changes where ``happens`` (n, 4); returns their indices in the window."""
        element, foot = np.nonzero(happens)
        self.rows.append(rows[element])
        self.feet.append(foot)
        self.times.append(times[element, foot])
        return element, foot

    def in_order(self) -> tuple[Indices, Indices, Array, Indices]:
        """Rows, feet and times sorted by row, foot and time, and the order that sorts them."""
        rows, feet = np.concatenate(self.rows), np.concatenate(self.feet)
        times = np.concatenate(self.times)
        order = np.lexsort((times, feet, rows))
        return rows[order], feet[order], times[order], order


class Accumulator:
    """Collects what B rollouts do, window by window, each up to its own end."""

    def __init__(self, start: Samples, feet: Feet, settings: RolloutSettings) -> None:
        """Begin at time 0 with the one sample ``start`` and the ``feet`` that stand then."""
        count, cycles = len(feet.stands), settings.n_cycles
        n_samples = cycles * settings.steps_per_cycle + 1
        self._settings = settings
        self._samples: dict[str, Any] = {
            name: _room(getattr(start, name), n_samples) for name in SAMPLED
        }
        self._velocity_jump: Array = np.zeros((count, cycles))
        self._foot_jump: Array = np.zeros((count, cycles, N_FEET))
        self._disagreements = np.zeros((count, cycles, N_FEET), dtype=np.int8)
        self._plan_seconds: Array = np.zeros((count, cycles))
        self._done = np.zeros(count, dtype=np.intp)
        self._touchdowns, self._liftoffs = _ContactChanges(), _ContactChanges()
        self._places_W: list[Array] = []
        self._land(np.arange(count), feet.stands, np.zeros((count, N_FEET)), feet.position_W)

    def add(self, rows: Indices, cycle: int, window: Window, plan_seconds: float) -> None:
        """Add the window of ``cycle`` for the rollouts ``rows`` (n).

        A window's last sample is overwritten by the first one of the next, so that each base node
        belongs to the plan in whose half-open window [t, t + Δt) it lies.
        """
        steps, period = self._settings.steps_per_cycle, self._settings.period
        span = slice(cycle * steps, (cycle + 1) * steps + 1)
        for name in SAMPLED:
            self._samples[name][rows, span] = getattr(window.samples, name)
        self._velocity_jump[rows, cycle] = window.velocity_jump
        self._foot_jump[rows, cycle] = window.foot_jump
        self._disagreements[rows, cycle] = window.changes.disagreement
        self._plan_seconds[rows, cycle] = plan_seconds
        self._done[rows] = cycle + 1
        start, changes = BASE_STEP * span.start, window.changes
        for times, stance in ((changes.landing, 0), (changes.touchdown, 1)):
            self._land(rows, times <= period, start + times, window.footholds_W[:, :, stance])
        self._liftoffs.add(rows, changes.liftoff <= period, start + changes.liftoff)

    def _land(self, rows: Indices, lands: Flags, times: Array, places_W: Array) -> None:
        element, foot = self._touchdowns.add(rows, lands, times)
        self._places_W.append(places_W[element, foot, :2])

    def close(self, replanner: str, courses: list[Course], endings: list[Ending]) -> list[Rollout]:
        """End the accumulation: the records, each motion cut at the end of its last window."""
        footholds = self._footholds()
        records = []
        for row, (course, ending) in enumerate(zip(courses, endings, strict=True)):
            done, until = int(self._done[row]), int(self._last()[row]) + 1
            samples = {name: np.array(self._samples[name][row, :until]) for name in SAMPLED}
            times: Array = BASE_STEP * np.arange(until, dtype=np.float64)
            records.append(
                Rollout(
                    replanner=replanner,
                    seed=course.seed,
                    index=course.index,
                    motion=Motion(times=times, footholds=footholds[row], **samples),
                    obstacles_W=course.obstacles_W,
                    ending=ending,
                    velocity_jump=np.array(self._velocity_jump[row, :done]),
                    foot_jump=np.array(self._foot_jump[row, :done]),
                    disagreements=np.array(self._disagreements[row, :done]),
                    plan_seconds=np.array(self._plan_seconds[row, :done]),
                )
            )
        return records

    def _footholds(self) -> list[Footholds]:
        """The footholds of each rollout; a foot that stands at the end stands until then."""
        rows, feet, touchdowns, order = self._touchdowns.in_order()
        places = np.concatenate(self._places_W)[order]
        everyone, last = np.arange(len(self._done)), self._last()
        ends = np.repeat(BASE_STEP * last[:, None], N_FEET, axis=1)
        self._liftoffs.add(everyone, self._samples["contact"][everyone, last], ends)
        # A foot touches down and lifts off in turn, so both lists have the same order and length.
        liftoffs = self._liftoffs.in_order()[2]
        return [
            Footholds(feet[mine], places[mine], touchdowns[mine], liftoffs[mine])
            for mine in (rows == row for row in everyone)
        ]

    def _last(self) -> Indices:
        """Index of each rollout's last sample."""
        return self._done * self._settings.steps_per_cycle


def _room(first: Array, n_samples: int) -> Array:
    """Zeros for ``n_samples`` samples, beginning with the one sample of ``first`` (B, 1, ...)."""
    room = np.zeros((len(first), n_samples, *first.shape[2:]), dtype=first.dtype)
    room[:, 0] = first[:, 0]
    return room
