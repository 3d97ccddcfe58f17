"""What a plan costs, by hand, and that the cheapest one is taken."""

import numpy as np
import pytest

from lmtr.errors import ModelError
from lmtr.geometry.se2 import SE2
from lmtr.policies.distance import TaskWeights
from lmtr.policies.mode_policy import ZeroModePolicy
from lmtr.replanners.build import build_replanner
from lmtr.replanners.plan_cost import PlanCost, feet_at_epoch
from lmtr.replanners.selecting import Selection
from lmtr.robot.model import ANYMAL
from lmtr.trajectory.sample import sample_base, sample_feet
from lmtr.vectors.layout import TASK_LAYOUT
from lmtr.vectors.segment_vector import decode_segment, encode_segment

FAR = np.array([[5.0, 0.0, np.pi / 2], [6.0, 0.0, np.pi / 2]])
NOTHING = {"obstacles": 0.0, "kinematics": 0.0, "jump": 0.0, "progress": 0.0}


@pytest.fixture
def x(walk_segments):
    """An expert's task."""
    return walk_segments.x[:1].copy()


@pytest.fixture
def tau(walk_segments):
    """Its plan, which goes with it, as one suggestion."""
    return walk_segments.tau[:1, None].copy()


def cost(name, x, tau, **changes):
    (of_plans,) = PlanCost(**{**NOTHING, name: 1.0, **changes}).of(x, tau, ANYMAL)
    return of_plans


def with_field(x, name, value):
    changed = x.copy()
    changed[:, TASK_LAYOUT.slice(name)] = np.ravel(value)
    return changed


def test_a_new_foothold_on_a_line_costs_one_and_half_the_clearance_a_quarter(x, tau):
    x = with_field(x, "next_lines", FAR)
    assert cost("obstacles", x, tau) == 0.0
    plan = decode_segment(tau[0, 0])
    ahead = np.sort(plan.footholds[:, 1, 0])[-1]
    for apart, expected in ((0.0, 1.0), (0.005, 0.25), (0.011, 0.0)):
        lines = FAR.copy()
        lines[0] = [ahead + apart, 0.0, np.pi / 2]
        found = cost("obstacles", with_field(x, "next_lines", lines), tau, clearance=0.01)
        others = plan.footholds[:, 1, 0] < ahead - 0.02
        assert others.sum() == 3  # only this foot is near
        assert found == pytest.approx(expected, abs=1e-6)


def test_feet_that_stand_are_judged_where_they_are(x, tau):
    limit = 0.05
    plan = decode_segment(tau[0, 0])
    times = 0.1 * np.arange(1.0, 9.0)
    base, feet = sample_base(plan, times), sample_feet(plan, times)
    excess, contacts = 0.0, 0
    for moment in range(8):
        yaw, pitch = base.rpy[moment, 2], base.rpy[moment, 1]
        forward = np.array(
            [np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), -np.sin(pitch)]
        )
        for foot, name in enumerate(("LF", "RF", "LH", "RH")):
            if not feet.contact[moment, foot]:
                continue
            place = feet.position[moment, foot]
            stood = x[0, TASK_LAYOUT.slice(f"{name}_time_since_liftoff")] == 0.0
            if feet.stance[moment, foot] == 0 and stood:
                place = x[0, TASK_LAYOUT.slice(f"{name}_position")]
            offset = (place - base.position[moment]) @ forward - ANYMAL.nominal_feet_B[foot, 0]
            excess += max(0.0, abs(offset) - limit)
            contacts += 1
    found = cost("kinematics", x, tau, forward_limit=limit, excess=0.01)
    assert excess > 0.0
    assert found == pytest.approx(excess / contacts / 0.01, rel=1e-6)


def test_a_plan_from_the_present_state_does_not_jump(x, tau):
    own = cost("jump", x, tau)
    assert own < 0.05
    velocity = x[:, TASK_LAYOUT.slice("linear_velocity")] + [0.3, 0.0, 0.4]
    assert cost("jump", with_field(x, "linear_velocity", velocity), tau) == pytest.approx(
        5, abs=0.1
    )
    moved = x[:, TASK_LAYOUT.slice("LF_position")] + [0.0, 0.2, 0.0]
    assert cost("jump", with_field(x, "LF_position", moved), tau) == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("later", [-0.4, -0.1, 0.0, 0.15, 0.3])
def test_feet_at_the_epoch_are_those_of_the_sampled_plan(walk_segments, later):
    plans = decode_segment(walk_segments.tau).moved(SE2.of(np.zeros(3)), later)
    expected = sample_feet(plans, np.zeros(1))
    np.testing.assert_allclose(feet_at_epoch(plans), expected.position[:, 0], atol=1e-12)
    lands = plans.touchdown_times[..., 0]
    swings = (plans.liftoff_times[..., 0] <= 0.0) & (lands > 0.0)
    assert (expected.contact[:, 0] == ~swings).all()


def test_progress_is_compared_among_the_plans_of_a_task(x, tau):
    plan = decode_segment(tau[0, 0])
    nodes = plan.base_nodes.copy()
    nodes[-1, 0, 0] += 0.05
    faster = encode_segment(type(plan)(**{**vars(plan), "base_nodes": nodes}))
    x = with_field(x, "goal_position", [1.0, 0.0])
    both = np.stack([tau[0, 0], faster])[None]
    np.testing.assert_allclose(cost("progress", x, both), [0.5, 0.0], atol=1e-6)


@pytest.mark.parametrize("kind", ["LMTR", "library"])
def test_the_cheapest_of_the_nearest_is_taken(models, walk_segments, kind):
    model = models[3] if kind == "LMTR" else None
    weights = TaskWeights()
    plain = build_replanner(model, walk_segments, weights)
    selection = Selection(candidates=5, cost=PlanCost(obstacles=3.0))
    chosen = build_replanner(model, walk_segments, weights, selection=selection, robot=ANYMAL).plan(
        walk_segments.x
    )
    plans = plain.suggest(walk_segments.x, 5)
    np.testing.assert_array_equal(plans[:, 0], plain.plan(walk_segments.x))
    costs = selection.cost.of(walk_segments.x, plans, ANYMAL)
    best = plans[np.arange(len(plans)), costs.argmin(axis=1)]
    np.testing.assert_array_equal(chosen, best)
    assert (costs.argmin(axis=1) > 0).any()


def test_what_has_one_plan_for_a_task_cannot_be_selected_from(models, walk_segments):
    cases = (
        (models[0], {}),
        (models[3], {"policy": ZeroModePolicy(3)}),
        (None, {"robot": None}),
    )
    for model, changes in cases:
        with pytest.raises(ModelError, match="cannot be selected from"):
            build_replanner(model, walk_segments, TaskWeights(), selection=Selection(), **changes)
