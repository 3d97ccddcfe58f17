"""A solution that leans on a limit of the problem says on which."""

from dataclasses import replace

import numpy as np
import pytest

from lmtr.expert.initial_guess import initial_guess
from lmtr.expert.saturation import saturated
from lmtr.expert.settings import ExpertSettings
from lmtr.expert.timing import windows
from lmtr.robot.model import ANYMAL
from lmtr.task.sampling import Noise
from lmtr.task.task import Task
from lmtr.trajectory.nodes import HEIGHT, VALUE

SETTINGS = ExpertSettings()
LIMITS = SETTINGS.limits


def guess():
    """The nominal walk, right fore foot first."""
    feet = ANYMAL.nominal_feet_B[:, :2].copy()
    feet[1, 0] -= 0.05
    task = Task(np.zeros(3), feet, np.array([2.0, 0.0, 0.0]), np.zeros((0, 3)))
    n_swings = SETTINGS.scope.n_swings
    quiet = Noise(np.zeros((3, 3)), np.zeros((4, 2 * n_swings)))
    return initial_guess(task, quiet, ANYMAL, SETTINGS.scope)


def limits_of(trajectory, order):
    return saturated(trajectory, order, windows(SETTINGS), ANYMAL, SETTINGS)


def later(times, by):
    """The third swing of the left hind foot, with its stance before and after it, shifted."""
    times = times.copy()
    times[2, 5:7] += by
    return times


def longer(times, duration):
    times = times.copy()
    times[3, 4] = times[3, 3] + duration
    return times


CASES = {
    "height": ("base_nodes", (30, VALUE, HEIGHT), ANYMAL.nominal_height - LIMITS.height),
    "tilt": ("base_nodes", (40, VALUE, 3), LIMITS.tilt),
    "force": ("force_nodes", (1, 2, 1, VALUE, 2), LIMITS.force * ANYMAL.weight),
    "swing_height": ("swing_nodes", (0, 3, 2), LIMITS.swing_height[0]),
    "window": ("contact_times", ..., lambda times: later(times, LIMITS.window)),
    "longest_swing": ("contact_times", ..., lambda times: longer(times, LIMITS.swing[1])),
}


def test_the_nominal_walk_lies_on_no_limit_whichever_foot_is_first():
    walk = guess()
    assert walk.order[0] == 1
    assert limits_of(walk.trajectory, walk.order) == ()


@pytest.mark.parametrize("share", [0.999, 0.9])
@pytest.mark.parametrize("limit", CASES)
def test_a_limit_is_named_when_it_is_reached_and_only_then(limit, share):
    walk, (name, index, value) = guess(), CASES[limit]
    nodes = getattr(walk.trajectory, name).copy()
    there = value(nodes) if callable(value) else value
    # All of the way to the limit, or less of it.
    nodes[index] = nodes[index] + share * (there - nodes[index])
    reached = limits_of(replace(walk.trajectory, **{name: nodes}), walk.order)
    assert reached == ((limit,) if share > 0.99 else ())


def test_both_ends_of_the_height_of_swings_count():
    walk = guess()
    nodes = walk.trajectory.swing_nodes.copy()
    nodes[3, 1, 2] = LIMITS.swing_height[1]
    assert limits_of(replace(walk.trajectory, swing_nodes=nodes), walk.order) == ("swing_height",)


def test_the_longest_stance_counts_between_two_swings():
    walk = guess()
    tight = SETTINGS.model_copy(update={"limits": LIMITS.model_copy(update={"stance": (0.2, 0.9)})})
    times = walk.trajectory.contact_times
    assert np.diff(times, axis=-1)[:, 2:-1:2].max() < 0.99 * 0.9
    stretched = times.copy()
    stretched[0, 3] = times[0, 2] + 0.9
    found = [
        saturated(
            replace(walk.trajectory, contact_times=each), walk.order, windows(tight), ANYMAL, tight
        )
        for each in (times, stretched)
    ]
    assert found == [(), ("longest_stance",)]


def test_the_shortest_phases_are_the_robots_and_count_as_nothing():
    walk = guess()
    times = longer(walk.trajectory.contact_times, LIMITS.swing[0])
    assert limits_of(replace(walk.trajectory, contact_times=times), walk.order) == ()
