"""A solution that leans on a limit of the problem says on which."""

import pytest

from lmtr.expert.saturation import saturated
from lmtr.expert.settings import ExpertSettings, Limits
from lmtr.expert.solve import Expert, Status
from lmtr.quality.limits import Limit
from lmtr.robot.model import ANYMAL
from lmtr.spline.bspline import hermite_nodes
from lmtr.trajectory.nodes import HEIGHT, VALUE
from lmtr.trajectory.trajectory import BASE_STEP

LIMITS = Limits()
NOMINAL = ANYMAL.nominal_height
LATE, EARLY = (2, slice(4, 6)), (1, slice(6, 8))
"""Third swing of the third foot and fourth of the second one, whole."""


@pytest.fixture
def walk(drawn_in_full):
    """The nominal walk as blocks of x; the drawn one is shaken."""
    blocks = drawn_in_full.problem.variables.unpack(drawn_in_full.start)
    blocks["control"][:, HEIGHT:] = NOMINAL, 0.0, 0.0, 0.0
    blocks["times"][:] = drawn_in_full.problem.windows.nominal[:, 1:-1]
    return blocks


@pytest.fixture
def limits_of(drawn_in_full):
    """The limits that blocks of x lie on."""
    problem = drawn_in_full.problem
    return lambda blocks: saturated(problem.variables.pack(blocks), problem, LIMITS)


def test_the_nominal_walk_lies_on_no_limit(walk, limits_of):
    assert limits_of(walk) == ()


SWING_LOW, SWING_HIGH = (height - 0.08 for height in LIMITS.swing_height)
CASES = [
    ("height", "control", (30, HEIGHT), NOMINAL - LIMITS.height),
    ("height", "control", (0, HEIGHT), NOMINAL + LIMITS.height),
    ("tilt", "control", (40, 3), LIMITS.tilt),
    ("tilt", "control", (41, 4), -LIMITS.tilt),
    ("force", "forces", (1, 2, 2), LIMITS.force),
    ("swing_height", "swing_offset", (0, 3, 2), SWING_LOW),
    ("swing_height", "swing_offset", (3, 1, 2), SWING_HIGH),
    ("window", "times", LATE, lambda there: there + LIMITS.window),
    ("window", "times", EARLY, lambda there: there - LIMITS.window),
]


@pytest.mark.parametrize("share", [0.995, 0.9])
@pytest.mark.parametrize(("limit", "block", "index", "value"), CASES)
def test_a_limit_is_named_when_it_is_reached_and_only_then(
    walk, limits_of, limit, block, index, value, share
):
    here = walk[block][index]
    there = value(here) if callable(value) else value
    walk[block][index] = here + share * (there - here)
    assert limits_of(walk) == ((limit,) if share > 0.98 else ())


@pytest.mark.parametrize(
    ("limit", "change", "duration"),
    [("longest_swing", 3, LIMITS.swing[1]), ("longest_stance", 4, LIMITS.stance[1])],
)
def test_the_longest_phases_count_between_two_changes(walk, limits_of, limit, change, duration):
    times = walk["times"]
    times[3, change] = times[3, change - 1] + 0.9 * duration
    assert limit not in limits_of(walk)
    times[3, change] = times[3, change - 1] + duration
    assert limit in limits_of(walk)


def test_what_is_the_robots_counts_as_nothing(walk, limits_of):
    walk["times"][0, 3] = walk["times"][0, 2] + LIMITS.swing[0]
    walk["times"][1, :2] += LIMITS.stance[0] - walk["times"][1, 0]  # where its window is cut
    walk["forces"][1, 2, 2] = 0.0
    assert limits_of(walk) == ()


def test_a_point_on_its_limit_counts_though_the_spline_keeps_clear_of_it(walk, limits_of):
    control = walk["control"]
    control[30, HEIGHT] = NOMINAL + LIMITS.height
    highest = hermite_nodes(control, BASE_STEP)[:, VALUE, HEIGHT].max()
    assert highest < NOMINAL + 0.7 * LIMITS.height
    assert limits_of(walk) == ("height",)


@pytest.mark.parametrize(
    ("limit", "tight"),
    [
        ("height", {"height": 0.02}),
        ("tilt", {"tilt": 0.03}),
        ("force", {"force": 0.75}),
        ("longest_stance", {"stance": (0.3, 0.75)}),
        ("window", {"window": 0.1}),
    ],
)
def test_a_solution_that_a_tight_limit_shapes_lies_on_it(short, nearby, limit, tight):
    settings = ExpertSettings(scope=short.scope, limits=Limits(**tight))
    solution = Expert(ANYMAL, settings, None).solve(*nearby(1))
    assert solution.status == Status.CONVERGED
    assert limit in solution.saturated
    assert solution.window_active == (limit == Limit.WINDOW)


def test_the_same_walk_lies_on_no_default_limit(short_expert, nearby):
    assert short_expert.solve(*nearby(1)).saturated == ()
