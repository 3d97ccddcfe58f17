"""The rollout testbed: what a replanner plans is what is accumulated, and nothing else."""

from dataclasses import fields, replace

import numpy as np
import pytest

from lmtr.errors import ConfigurationError, DataError, ModelError
from lmtr.geometry.se2 import SE2
from lmtr.robot.model import ANYMAL, HYQ
from lmtr.rollout.contacts import Disagreement
from lmtr.rollout.courses import random_courses
from lmtr.rollout.record import Ending
from lmtr.rollout.settings import PlausibleRange, RolloutSettings
from lmtr.rollout.starts import draw_starts
from lmtr.rollout.testbed import run_rollouts
from lmtr.trajectory.motion import sampled
from lmtr.trajectory.trajectory import Trajectory
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT
from lmtr.vectors.segment_vector import encode_segment

FIRST_EPOCH = 0.5


def assert_equal_motions(left, right):
    for field in fields(left):
        if field.name != "footholds":
            np.testing.assert_array_equal(getattr(left, field.name), getattr(right, field.name))
    for field in fields(left.footholds):
        np.testing.assert_array_equal(
            getattr(left.footholds, field.name), getattr(right.footholds, field.name)
        )


def from_library(library, settings, indices, **changes):
    courses = random_courses(settings, 11, indices)
    starts = draw_starts(library.tau, courses)
    return run_rollouts(replace(library, **changes), courses, starts, settings, ANYMAL)


def test_replaying_a_walk_window_by_window_gives_the_walk_back(oracle, short):
    rollouts = run_rollouts(
        oracle, random_courses(short, 0, range(3)), oracle.windows(0), short, ANYMAL
    )
    for walk, rollout in zip(oracle.walks, rollouts, strict=True):
        start = walk.base_nodes[5, 0]  # the node at the first epoch
        seen = walk.seen_from(SE2(start[0], start[1], start[5]), FIRST_EPOCH)
        expected, motion = sampled(seen, 0.1), rollout.motion
        then = slice(5, 5 + len(motion.times))  # the samples from the first epoch on
        assert rollout.ending is Ending.COMPLETED
        assert len(motion.times) == 61
        for name in (
            "times",
            "base_position_W",
            "base_rpy",
            "base_velocity_W",
            "base_angular_velocity_W",
            "foot_position_W",
            "contact",
        ):
            np.testing.assert_allclose(
                getattr(motion, name), getattr(expected, name)[then], atol=1e-12, err_msg=name
            )
        np.testing.assert_allclose(motion.foot_force_W, expected.foot_force_W[then], atol=1e-8)
        assert not rollout.disagreements.any()
        assert rollout.velocity_jump.max() < 1e-12
        assert rollout.foot_jump.max() < 1e-12


def test_footholds_of_a_replayed_walk_are_those_of_the_walk(oracle, short):
    rollouts = run_rollouts(
        oracle, random_courses(short, 0, range(3)), oracle.windows(0), short, ANYMAL
    )
    for walk, rollout in zip(oracle.walks, rollouts, strict=True):
        start = walk.base_nodes[5, 0]
        walked = sampled(walk.seen_from(SE2(start[0], start[1], start[5]), FIRST_EPOCH), 0.1)
        footholds = walked.footholds
        during = (footholds.liftoff > 0.0) & (footholds.touchdown <= 6.0)
        found = rollout.motion.footholds
        np.testing.assert_array_equal(found.foot, footholds.foot[during])
        np.testing.assert_allclose(found.position_W, footholds.position_W[during], atol=1e-12)
        touchdown = np.maximum(footholds.touchdown[during], 0.0)
        np.testing.assert_allclose(found.touchdown, touchdown, atol=1e-12)
        liftoff = np.minimum(footholds.liftoff[during], 6.0)
        np.testing.assert_allclose(found.liftoff, liftoff, atol=1e-12)


def test_standing_feet_stand_exactly_still_whatever_plans_say(library, short):
    rollouts = from_library(library, short, range(8))
    kinds = np.unique(np.concatenate([r.disagreements.ravel() for r in rollouts]))
    assert set(kinds.tolist()) == {int(kind) for kind in Disagreement}, "the case must be hard"
    for rollout in rollouts:
        motion, holds = rollout.motion, rollout.motion.footholds
        stands = np.zeros_like(motion.contact)
        for foot, place, touchdown, liftoff in zip(
            holds.foot, holds.position_W, holds.touchdown, holds.liftoff, strict=True
        ):
            assert touchdown <= liftoff
            inside = (motion.times > touchdown - 1e-9) & (motion.times < liftoff - 1e-9)
            inside |= (motion.times == motion.times[-1]) & (liftoff >= motion.times[-1])
            np.testing.assert_array_equal(
                motion.foot_position_W[inside, foot],
                np.broadcast_to([*place, 0.0], (inside.sum(), 3)),
            )
            stands[inside, foot] = True
        np.testing.assert_array_equal(motion.contact, stands)
        assert not motion.foot_force_W[~motion.contact].any()


def test_each_stance_of_a_foot_ends_before_the_next_begins(library, short):
    for rollout in from_library(library, short, range(8)):
        holds = rollout.motion.footholds
        same_foot = holds.foot[1:] == holds.foot[:-1]
        assert (holds.liftoff[:-1] < holds.touchdown[1:])[same_foot].all()
        assert (np.diff(holds.foot) >= 0).all()


def test_a_rollout_is_the_same_alone_and_in_any_batch(library, short):
    together = from_library(library, short, range(6))
    backwards = from_library(library, short, [4, 2])
    alone = from_library(library, short, [2])
    assert [r.index for r in backwards] == [4, 2]
    assert_equal_motions(together[2].motion, alone[0].motion)
    assert_equal_motions(backwards[1].motion, alone[0].motion)
    np.testing.assert_array_equal(together[2].foot_jump, alone[0].foot_jump)
    np.testing.assert_array_equal(together[2].disagreements, alone[0].disagreements)


def test_tasks_show_the_goal_ahead_on_the_world_x_axis(oracle, short):
    seen = []

    class Listening:
        name, nbytes = "listening", 0

        def plan(self, x):
            seen.append(TASK_LAYOUT.unpack(x))
            return oracle.plan(x)

    courses = random_courses(short, 0, range(3))
    rollouts = run_rollouts(Listening(), courses, oracle.windows(0), short, ANYMAL)
    for row, rollout in enumerate(rollouts):
        for cycle, parts in enumerate(seen):
            base = rollout.motion.base_position_W[3 * cycle]
            yaw = rollout.motion.base_rpy[3 * cycle, 2]
            frame = SE2(base[0], base[1], yaw)
            goal = frame.apply(parts["goal_position"][row])
            np.testing.assert_allclose(goal, [base[0] + 0.8, 0.0], atol=1e-12)
            c, s = parts["goal_heading"][row]
            np.testing.assert_allclose(np.arctan2(s, c), -yaw, atol=1e-12)


class Breaking:
    """Replays the walks, but spoils the plan of row 1 from cycle 4 on."""

    name, nbytes = "breaking", 0

    def __init__(self, oracle, spoil):
        self.oracle, self.spoil, self.tasks = oracle, spoil, []

    def plan(self, x):
        tau = self.oracle.plan(x)
        self.tasks.append(x)
        if self.oracle.cycle == 5 and self.spoil is not None:
            tau[1] = self.spoil(tau[1])
        return tau if len(x) == 3 else tau[[0, 2]]


def base_at(derivative, coordinate, value):
    """A spoiler of one coordinate of all base nodes: their value (0) or time derivative (1)."""

    def spoil(tau):
        parts = SEGMENT_LAYOUT.unpack(np.array(tau))
        nodes = np.array(parts["base_nodes"])
        nodes[:, derivative, coordinate] = value
        return SEGMENT_LAYOUT.pack({**parts, "base_nodes": nodes})

    return spoil


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda tau: np.full_like(tau, np.nan), Ending.NOT_FINITE),
        (lambda tau: np.full_like(tau, np.inf), Ending.NOT_FINITE),
        (lambda tau: np.where(np.arange(264) == 200, np.nan, tau), Ending.NOT_FINITE),
        (lambda tau: np.full_like(tau, 1e200), Ending.NOT_FINITE),
        (base_at(0, 2, 0.1), Ending.BASE_HEIGHT),
        (base_at(0, 4, 1.2), Ending.TILT),
        (base_at(1, 1, 2.0), Ending.SPEED),
        (base_at(0, 0, 0.9), Ending.FOOT_OFFSET),
    ],
)
def test_a_rollout_that_leaves_the_plausible_range_ends_and_the_others_go_on(
    oracle, short, spoil, reason
):
    courses = random_courses(short, 0, range(3))
    breaking = Breaking(oracle, spoil)
    rollouts = run_rollouts(breaking, courses, oracle.windows(0), short, ANYMAL)
    assert [r.ending for r in rollouts] == [Ending.COMPLETED, reason, Ending.COMPLETED]
    ended = rollouts[1]
    assert ended.diverged
    assert ended.end_time == pytest.approx(1.2)
    assert len(ended.velocity_jump) == len(ended.disagreements) == len(ended.plan_seconds) == 4
    assert ended.motion.footholds.liftoff.max() <= 1.2 + 1e-12
    assert np.isfinite(ended.motion.base_position_W).all()

    oracle.cycle = 0
    unbroken = Breaking(oracle, None)
    whole = run_rollouts(unbroken, courses, oracle.windows(0), short, ANYMAL)
    # A rollout that ended is not planned for, and the others' tasks remain their own.
    assert len(breaking.tasks) == len(unbroken.tasks) == 20
    for tasks, expected in zip(breaking.tasks[5:], unbroken.tasks[5:], strict=True):
        np.testing.assert_array_equal(tasks, expected[[0, 2]])
    assert_equal_motions(rollouts[2].motion, whole[2].motion)
    # The last sample ends one plan here and begins the next one there: equal to rounding.
    expected = whole[1].motion.base_position_W[:13]
    np.testing.assert_array_equal(ended.motion.base_position_W[:-1], expected[:-1])
    np.testing.assert_allclose(ended.motion.base_position_W[-1], expected[-1], atol=1e-12)


def test_a_plan_that_fails_at_once_leaves_the_start(oracle, short):
    class Broken:
        name, nbytes = "broken", 0

        def plan(self, x):
            return np.full((len(x), 264), np.nan)

    courses = random_courses(short, 0, range(3))
    rollouts = run_rollouts(Broken(), courses, oracle.windows(0), short, ANYMAL)
    assert all(r.ending is Ending.NOT_FINITE for r in rollouts)
    assert all(len(r.motion.times) == 1 and r.end_time == 0.0 for r in rollouts)


class Marching:
    """Marches on the spot: all feet swing together in every other cycle, from end to end of it."""

    name, nbytes = "marching", 0

    def __init__(self):
        self.cycle = 0

    def plan(self, x):
        nodes = np.zeros((9, 2, 6))
        nodes[:, 0, 2] = ANYMAL.nominal_height
        swings = self.cycle % 2 == 1
        times = np.array([-0.3, 0.0, 0.3, 0.9] if swings else [0.0, 0.3, 0.6, 0.9])
        step = np.array([0.02 * (self.cycle + 1), 0.0, 0.0])
        feet = ANYMAL.nominal_feet_B * np.array([1.0, 1.0, 0.0])
        self.cycle += 1
        segment = Trajectory(
            base_start=np.zeros(()),
            base_nodes=nodes,
            contact_times=np.tile(times, (4, 1)),
            footholds=np.stack([feet, feet + step], axis=1),
            swing_nodes=np.concatenate([feet, np.zeros((4, 2))], axis=-1)[:, None],
            force_nodes=np.zeros((4, 2, 3, 2, 3)),
        )
        return np.tile(encode_segment(segment), (len(x), 1))


def test_contact_changes_on_replanning_times_happen_once_and_without_disagreement():
    settings, marching = RolloutSettings(duration=2.4), Marching()
    start = Marching().plan(np.zeros((1, 35)))
    rollout = run_rollouts(marching, random_courses(settings, 0, [0]), start, settings, ANYMAL)[0]
    holds = rollout.motion.footholds
    assert not rollout.disagreements.any()
    for foot in range(4):
        mine = holds.foot == foot
        np.testing.assert_allclose(holds.touchdown[mine], [0.0, 0.6, 1.2, 1.8, 2.4], atol=1e-12)
        np.testing.assert_allclose(holds.liftoff[mine], [0.3, 0.9, 1.5, 2.1, 2.4], atol=1e-12)
        forward = holds.position_W[mine, 0] - ANYMAL.nominal_feet_B[foot, 0]
        np.testing.assert_allclose(forward, [0.0, 0.04, 0.08, 0.12, 0.16], atol=1e-12)
    stands = np.repeat([True, False] * 4, 3)
    np.testing.assert_array_equal(rollout.motion.contact[:-1], np.tile(stands[:, None], (1, 4)))
    assert rollout.motion.contact[-1].all()


def test_progress_is_reported_after_every_cycle(oracle, short):
    heard = []
    run_rollouts(
        oracle,
        random_courses(short, 0, range(3)),
        oracle.windows(0),
        short,
        ANYMAL,
        report=heard.append,
    )
    assert [p.cycle for p in heard] == list(range(1, 21))
    assert {(p.n_cycles, p.running, p.rollouts) for p in heard} == {(20, 3, 3)}


def test_misuse_is_refused_with_the_remedy(oracle, short):
    courses = random_courses(short, 0, range(3))
    starts = oracle.windows(0)
    with pytest.raises(ConfigurationError, match="one segment vector for each course"):
        run_rollouts(oracle, courses, starts[:2], short, ANYMAL)
    with pytest.raises(ConfigurationError, match="at least one"):
        run_rollouts(oracle, [], starts[:0], short, ANYMAL)
    with pytest.raises(DataError, match="row 0"):
        run_rollouts(oracle, courses, starts, short, HYQ.model_copy(update={"nominal_height": 1.2}))
    spoiled = np.array(starts)
    spoiled[1, 7] = np.nan
    with pytest.raises(DataError, match=r"rows \[1\]"):
        run_rollouts(oracle, courses, spoiled, short, ANYMAL)
    oracle.walks = oracle.walks[:2]
    with pytest.raises(ModelError, match="must have shape"):
        run_rollouts(oracle, courses, starts, short, ANYMAL)


def test_longer_rollouts_begin_like_shorter_ones(library, short):
    longer = RolloutSettings(duration=7.5, plausible=PlausibleRange(foot_offset=0.6))
    brief = from_library(library, short, [1])[0]
    extended = from_library(library, longer, [1])[0]
    np.testing.assert_array_equal(
        extended.motion.base_position_W[:60], brief.motion.base_position_W[:60]
    )
