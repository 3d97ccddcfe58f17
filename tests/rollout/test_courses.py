"""Courses, starts, missions and settings of rollouts."""

import numpy as np
import pytest
from pydantic import ValidationError

from lmtr.errors import ConfigurationError, DataError
from lmtr.rollout.courses import obstacle_array, random_course, random_courses
from lmtr.rollout.mission import goal_ahead_W
from lmtr.rollout.settings import PlausibleRange, RolloutSettings
from lmtr.rollout.starts import draw_starts

SETTINGS = RolloutSettings()


def test_a_course_depends_on_seed_and_index_alone():
    alone = random_course(SETTINGS, 4, 7)
    among = random_courses(SETTINGS, 4, range(9, 5, -1))[2]
    assert (among.seed, among.index) == (4, 7)
    np.testing.assert_array_equal(alone.obstacles_W, among.obstacles_W)
    for other in (random_course(SETTINGS, 4, 8), random_course(SETTINGS, 5, 7)):
        assert not np.isclose(other.obstacles_W[:, 0], alone.obstacles_W[:, 0]).any()


def test_spacing_and_turn_are_uniform_in_their_ranges():
    lines = np.concatenate([c.obstacles_W for c in random_courses(SETTINGS, 0, range(200))])
    first = lines.reshape(200, -1, 3)[:, 0, 0]
    gaps = np.diff(lines.reshape(200, -1, 3)[..., 0], axis=1)
    turns = lines[:, 2] - np.pi / 2.0
    assert first.min() >= 0.7
    assert first.max() <= 1.1
    assert gaps.min() >= 0.5
    assert gaps.max() <= 1.1
    assert gaps.mean() == pytest.approx(0.8, abs=0.01)
    assert np.abs(turns).max() <= 0.5
    assert turns.std() == pytest.approx(0.5 / np.sqrt(3.0), rel=0.02)
    assert (lines[:, 1] == 0.0).all()


def test_no_plausible_robot_outruns_a_course():
    for seed in range(20):
        furthest = random_course(SETTINGS, seed, 0).obstacles_W[-1, 0]
        assert furthest > SETTINGS.plausible.speed * SETTINGS.duration


def test_a_longer_course_begins_like_a_shorter_one():
    brief = random_course(RolloutSettings(duration=6.0), 1, 3).obstacles_W
    whole = random_course(SETTINGS, 1, 3).obstacles_W
    np.testing.assert_array_equal(whole[: len(brief)], brief)


def test_courses_of_one_batch_have_one_length():
    brief, whole = random_course(RolloutSettings(duration=6.0), 1, 3), random_course(SETTINGS, 1, 4)
    assert obstacle_array([whole, whole]).shape == (2, SETTINGS.n_lines, 3)
    with pytest.raises(ConfigurationError, match="same number of lines"):
        obstacle_array([brief, whole])


def test_starts_follow_seed_and_index_and_use_the_whole_pool():
    pool = np.arange(10.0)[:, None] * np.ones(264)
    courses = random_courses(RolloutSettings(duration=0.3), 2, range(200))
    starts = draw_starts(pool, courses)
    np.testing.assert_array_equal(draw_starts(pool, courses[50:60][::-1]), starts[50:60][::-1])
    assert set(starts[:, 0]) == set(range(10))
    with pytest.raises(DataError, match="pool"):
        draw_starts(pool[:0], courses)


def test_the_goal_is_ahead_on_the_world_x_axis():
    goals = goal_ahead_W(np.array([-0.3, 2.0]), 0.8)
    np.testing.assert_allclose(goals, [[0.5, 0.0, 0.0], [2.8, 0.0, 0.0]], atol=1e-15)


def test_the_default_is_the_papers_scheme():
    assert SETTINGS.period == 0.3
    assert SETTINGS.n_cycles == 100
    assert SETTINGS.steps_per_cycle == 3


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"period": 0.25}, "multiple of the base nodes' spacing"),
        ({"period": 0.9, "duration": 27.0}, "must not exceed a segment's 0.8 s"),
        ({"duration": 0.2}, "multiple of the period"),
        ({"obstacle_spacing": (1.1, 0.5)}, "must ascend"),
        ({"landing_time": 0.3}, "shorter than the period"),
        ({"duration": float("nan")}, "duration"),
        ({"speed": 1.0}, "speed"),
    ],
)
def test_impossible_settings_are_refused(change, message):
    with pytest.raises(ValidationError, match=message):
        RolloutSettings(**change)


def test_plausible_heights_enclose_the_nominal_one():
    with pytest.raises(ValidationError, match="must enclose 1"):
        PlausibleRange(height=(1.1, 1.5))
