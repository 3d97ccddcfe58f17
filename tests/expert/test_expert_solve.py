"""Solutions of the expert: they converge, keep their promises, and fail as values."""

from dataclasses import fields, replace

import numpy as np
import pytest
from pydantic import ValidationError

from lmtr.errors import TaskError
from lmtr.expert.settings import ExpertSettings, Scope, SolverSettings
from lmtr.expert.solve import Expert, Status
from lmtr.geometry.line import signed_distance
from lmtr.robot.model import ANYMAL, HYQ
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import TaskDistribution, sample_noise, sample_task
from lmtr.trajectory.sample import sample_base, sample_feet

EVERYWHERE = np.arange(0.0, 7.5001, 0.01)


def test_a_task_of_the_paper_is_solved(solved):
    _, solution = solved
    assert solution.status == Status.CONVERGED, solution.message
    assert set(solution.constraint_violation) == {
        "dynamics",
        "range_of_motion",
        "timing",
        "friction",
        "bounds",
    }
    assert max(solution.constraint_violation.values()) < 1e-3
    assert solution.iterations > 5
    assert solution.solve_cpu_s > 0.0


def test_named_costs_add_up(solved):
    _, solution = solved
    assert solution.cost == pytest.approx(sum(solution.cost_terms.values()))
    assert {"obstacles", "foot_offset", "acceleration"} <= set(solution.cost_terms)
    assert min(solution.cost_terms.values()) >= 0.0


def test_motion_begins_and_ends_at_rest_where_it_should(solved):
    task, solution = solved
    base = sample_base(solution.trajectory, np.array([0.0, 7.5]))
    for pose, node in ((task.start_pose_W, 0), (task.goal_pose_W, 1)):
        np.testing.assert_allclose(base.position[node], [*pose[:2], 0.42], atol=1e-9)
        np.testing.assert_allclose(base.rpy[node], [0.0, 0.0, pose[2]], atol=1e-9)
    for name in ("velocity", "acceleration", "rpy_rate", "rpy_acceleration"):
        np.testing.assert_allclose(getattr(base, name), 0.0, atol=1e-8)
    np.testing.assert_allclose(solution.trajectory.footholds[:, 0, :2], task.start_feet_W)


def test_forces_lift_the_weight_and_respect_friction_at_all_times(solved):
    _, solution = solved
    force = sample_feet(solution.trajectory, EVERYWHERE).force / ANYMAL.weight
    assert np.abs(force[..., :2]).max(axis=-1) == pytest.approx(
        np.minimum(np.abs(force[..., :2]).max(axis=-1), ANYMAL.friction * force[..., 2]), abs=1e-6
    )
    assert force[..., 2].min() > -1e-7
    assert force[..., 2].max() < 1.5 + 1e-7
    assert force[..., 2].sum(axis=1).mean() == pytest.approx(1.0, abs=0.01)


def test_phases_keep_their_durations(solved):
    _, solution = solved
    phases = np.diff(solution.trajectory.contact_times, axis=1)
    assert phases.min() > 0.2 - 1e-4
    assert phases[:, 1::2].max() < 0.7 + 1e-4
    assert not solution.window_active


def test_footholds_keep_away_from_lines_only_if_told_to(short_expert, expert_cache, nearby, short):
    careless = Expert(ANYMAL, short.model_copy(update={"obstacle_weight": 0.0}), expert_cache)
    closest = {short_expert: [], careless: []}
    for index in range(3):
        task, noise = nearby(index)
        for expert, distances in closest.items():
            feet = expert.solve(task, noise).trajectory.footholds[:, 1:]
            lines = task.obstacles_W[:, None, None]
            distances.append(np.abs(signed_distance(lines, feet)).min())
    assert min(closest[short_expert]) > 0.05
    assert min(closest[careless]) < 0.05
    assert np.mean(closest[short_expert]) > np.mean(closest[careless]) + 0.03
    if short_expert.compiled:
        assert careless.build_report.cached, "weights must not be compiled in"


def test_the_same_task_gives_the_same_solution(short_expert, nearby):
    task, noise = nearby(0)
    first, second = short_expert.solve(task, noise), short_expert.solve(task, noise)
    for field in fields(first.trajectory):
        np.testing.assert_array_equal(
            getattr(first.trajectory, field.name), getattr(second.trajectory, field.name)
        )
    assert first.cost == second.cost


def test_the_frame_of_the_world_does_not_matter(short_expert, nearby):
    """A task a hundred metres away is the same task: only friction's axes stay the world's."""
    task, noise = nearby(0)
    shift = np.array([100.0, -50.0, 0.0])
    moved = replace(
        task,
        start_pose_W=task.start_pose_W + shift,
        start_feet_W=task.start_feet_W + shift[:2],
        goal_pose_W=task.goal_pose_W + shift,
        obstacles_W=task.obstacles_W + shift,
    )
    here, there = short_expert.solve(task, noise), short_expert.solve(moved, noise)
    assert there.status == Status.CONVERGED
    assert there.cost == pytest.approx(here.cost, rel=5e-3)


def test_every_first_foot_is_served_by_one_problem(short_expert, nearby):
    orders = set()
    for index in range(6):
        task, noise = nearby(index)
        solution = short_expert.solve(task, noise)
        assert solution.status == Status.CONVERGED, solution.message
        orders.add(solution.order)
    assert len(orders) >= 3


def test_running_out_of_iterations_is_a_status(expert_cache, nearby, short):
    hasty = short.model_copy(update={"solver": SolverSettings(max_iterations=2)})
    solution = Expert(ANYMAL, hasty, expert_cache).solve(*nearby(0))
    assert solution.status == Status.ITERATION_LIMIT
    assert solution.iterations == 2
    assert solution.trajectory.is_finite()


def test_a_goal_out_of_reach_fails_as_a_status(short_expert, nearby):
    task, noise = nearby(0)
    far = replace(task, goal_pose_W=np.array([1.85, 0.0, 0.0]))
    solution = short_expert.solve(far, noise)
    assert solution.status != Status.CONVERGED
    assert solution.trajectory.is_finite()
    assert solution.constraint_violation["range_of_motion"] > 0.0 or (
        solution.constraint_violation["dynamics"] > 0.0
    )


def test_misuse_is_refused_by_name(short_expert, nearby):
    task, noise = nearby(0)
    with pytest.raises(TaskError, match="goal_pose_W must be finite"):
        replace(task, goal_pose_W=np.array([np.nan, 0.0, 0.0]))
    with pytest.raises(TaskError, match="obstacles_W has 5 lines"):
        short_expert.solve(replace(task, obstacles_W=np.ones((5, 3))), noise)
    with pytest.raises(TaskError, match="start foot LF"):
        short_expert.solve(replace(task, start_feet_W=task.start_feet_W + 0.5), noise)


def test_a_non_finite_start_gives_back_the_guess(short_expert, monkeypatch, nearby):
    task, noise = nearby(0)
    outcome = short_expert._solver.solve

    def to_nowhere(start, parameters):
        return replace(outcome(start, parameters), iterate=np.full_like(start, np.nan))

    monkeypatch.setattr(short_expert._solver, "solve", to_nowhere)
    solution = short_expert.solve(task, noise)
    np.testing.assert_array_equal(solution.trajectory.base_nodes, solution.guess.base_nodes)
    assert np.isfinite(solution.cost)


def test_a_single_swing_per_leg_is_a_problem_too():
    """No stance then lies between two swings."""
    settings = ExpertSettings(scope=Scope(duration=1.6, n_swings=1))
    tasks = TaskDistribution(goal_distance=(0.2, 0.25), goal_lateral=0.0, obstacle_count=(0, 0))
    rng = stream(0, Purpose.TASK, 0)
    task = sample_task(tasks, ANYMAL, rng)
    solution = Expert(ANYMAL, settings, None).solve(task, sample_noise(tasks, 1, rng))
    assert solution.status == Status.CONVERGED, solution.message


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"range_of_motion_step": 0.03}, "must divide the base's knot spacing"),
        ({"scope": {"duration": 7.53}}, "must be a multiple of"),
        ({"limits": {"swing": (0.5, 0.2)}}, r"swing\s.*must ascend"),
        ({"obstacle_weight": float("nan")}, "obstacle_weight"),
        ({"weight": 1.0}, "Extra inputs"),
    ],
)
def test_settings_are_checked_when_made(wrong, message):
    with pytest.raises(ValidationError, match=message):
        ExpertSettings.model_validate(wrong)


@pytest.mark.slow
@pytest.mark.parametrize("robot", [ANYMAL, HYQ], ids=lambda robot: robot.name)
def test_nearly_all_tasks_converge(robot):
    tasks, settings = TaskDistribution(), ExpertSettings()
    expert = Expert(robot, settings, None)
    converged = 0
    for index in range(20):
        rng = stream(0, Purpose.TASK, index)
        task = sample_task(tasks, robot, rng)
        noise = sample_noise(tasks, settings.scope.n_swings, rng)
        converged += expert.solve(task, noise).status == Status.CONVERGED
    assert converged >= 19
