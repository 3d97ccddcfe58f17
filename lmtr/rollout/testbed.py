"""The rollout testbed: replanning from what was accumulated, cycle by cycle (Sec. 5.1).

All rollouts of a batch run side by side and are planned for in one call a cycle. Nothing couples
them: each one is the same in any batch, as far as the replanner's own arithmetic is.
"""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from lmtr.arrays import Array
from lmtr.errors import ConfigurationError, DataError, ModelError
from lmtr.replanners.replanner import Replanner
from lmtr.robot.model import RobotModel
from lmtr.rollout.accumulate import Accumulator
from lmtr.rollout.batch import taken
from lmtr.rollout.courses import Course, obstacle_array
from lmtr.rollout.mission import goal_ahead_W
from lmtr.rollout.plausibility import judged, legible
from lmtr.rollout.record import Ending, Rollout
from lmtr.rollout.settings import RolloutSettings
from lmtr.rollout.window import Instant, Window, begin, carry_out
from lmtr.trajectory.trajectory import Trajectory
from lmtr.vectors.layout import SEGMENT_LAYOUT
from lmtr.vectors.segment_vector import decode_segment
from lmtr.vectors.task_vector import encode_task


@dataclass(frozen=True)
class Progress:
    """How far a batch of rollouts has come.

    Attributes:
        cycle: Replanning cycles done.
        n_cycles: Replanning cycles in all.
        running: Rollouts that have not diverged.
        rollouts: Rollouts in all.
    """

    cycle: int
    n_cycles: int
    running: int
    rollouts: int


def run_rollouts(
    replanner: Replanner,
    courses: list[Course],
    starts: Array,
    settings: RolloutSettings,
    robot: RobotModel,
    report: Callable[[Progress], None] | None = None,
) -> list[Rollout]:
    """Let a replanner walk over each of the courses.

    A rollout that a plan would take out of the plausible range ends at the replanning time before
    it; the others go on.

    Args:
        replanner: Plans for the whole batch at once.
        courses: One for each rollout, B of them.
        starts: Segment vectors τ, (B, 264), at whose epoch the rollouts start, with the base over
            the world's origin and its yaw 0: states of the training distribution.
        settings: Replanning period, duration, mission and limits.
        robot: Whose nominal stance the plausible range is relative to.
        report: Called after each cycle.

    Returns:
        One record for each course, in their order.

    Raises:
        ConfigurationError: Courses and starts do not match.
        DataError: A start is not finite or not plausible.
        ModelError: The replanner returns an array of another shape.
    """
    first, here = begin(_decoded_starts(courses, starts, settings, robot))
    lines_W = obstacle_array(courses)
    accumulator = Accumulator(first, here.feet, settings)
    endings = [Ending.COMPLETED for _ in courses]
    rows = np.arange(len(courses))
    for cycle in range(settings.n_cycles):
        window, ends, seconds = _cycle(replanner, here, lines_W[rows], settings, robot)
        for row, end in zip(rows, ends, strict=True):
            endings[row] = end
        goes_on = np.array([end is Ending.COMPLETED for end in ends])
        rows, window = rows[goes_on], taken(window, goes_on)
        accumulator.add(rows, cycle, window, seconds)
        here = window.end
        if report is not None:
            report(Progress(cycle + 1, settings.n_cycles, len(rows), len(courses)))
        if len(rows) == 0:
            break
    return accumulator.close(replanner.name, courses, endings)


def _cycle(
    replanner: Replanner,
    here: Instant,
    lines_W: Array,
    settings: RolloutSettings,
    robot: RobotModel,
) -> tuple[Window, list[Ending], float]:
    """One replanning of n rollouts: windows, endings, planning time of each (s)."""
    goal_W = goal_ahead_W(here.state.frame_W.x, settings.goal_distance)
    x = encode_task(here.state, lines_W, goal_W)
    begun = perf_counter()
    tau = np.asarray(replanner.plan(x), dtype=np.float64)
    seconds = (perf_counter() - begun) / len(x)
    if tau.shape != (len(x), SEGMENT_LAYOUT.size):
        raise ModelError(
            f"replanner {replanner.name!r}: a plan for {len(x)} tasks must have shape "
            f"({len(x)}, {SEGMENT_LAYOUT.size}), got {tau.shape}; mend its plan method"
        )
    readable = legible(tau)
    # A plan that cannot be read is put to zero: the batch goes on, and its rollout ends here.
    plan = decode_segment(np.where(readable[:, None], tau, 0.0))
    window = carry_out(plan, here, settings)
    endings = judged(window.samples, settings.plausible, robot)
    ends = [
        end if can_read else Ending.NOT_FINITE
        for end, can_read in zip(endings, readable, strict=True)
    ]
    return window, ends, seconds


def _decoded_starts(
    courses: list[Course], starts: Array, settings: RolloutSettings, robot: RobotModel
) -> Trajectory:
    expected = (len(courses), SEGMENT_LAYOUT.size)
    if not courses or np.shape(starts) != expected:
        raise ConfigurationError(
            f"rollouts: {len(courses)} courses need starts of shape {expected} and at least one "
            f"course, got {np.shape(starts)}; give one segment vector for each course"
        )
    unreadable = np.flatnonzero(~legible(starts))
    if len(unreadable) > 0:
        raise DataError(
            f"rollouts: starts must be finite, rows {unreadable[:5].tolist()} are not; "
            "choose others"
        )
    segments = decode_segment(starts)
    endings = judged(begin(segments)[0], settings.plausible, robot)
    for row, ending in enumerate(endings):
        if ending is not Ending.COMPLETED:
            raise DataError(
                f"rollouts: starts must be plausible for robot {robot.name!r}, row {row} is not "
                f"({ending}); choose segments of this robot"
            )
    return segments
