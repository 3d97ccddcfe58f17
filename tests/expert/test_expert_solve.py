"""Solutions of the expert: they converge, keep their promises, and fail as values."""

import os
import signal
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields, replace

import casadi as ca
import numpy as np
import pytest
from pydantic import ValidationError

from lmtr.errors import ConfigurationError, TaskError
from lmtr.expert.initial_guess import contact_times
from lmtr.expert.settings import ExpertSettings, Limits, Scope, SolverSettings
from lmtr.expert.solve import Expert, Status
from lmtr.expert.solver import EARLY_CONSTRAINT_TOLERANCE, InteriorPoint
from lmtr.geometry.line import signed_distance
from lmtr.robot.model import ANYMAL, HYQ, RobotModel
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import TaskDistribution, sample_noise, sample_task
from lmtr.trajectory.sample import sample_base


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
    assert max(solution.constraint_violation.values()) < EARLY_CONSTRAINT_TOLERANCE
    assert solution.iterations > 5
    assert solution.solve_cpu_s > 0.0


def test_named_costs_add_up_to_the_solvers_own_objective(short, nearby, monkeypatch):
    solvers, nlpsol = [], ca.nlpsol

    def kept(*arguments):
        solvers.append(nlpsol(*arguments))
        return solvers[-1]

    monkeypatch.setattr(ca, "nlpsol", kept)
    solution = Expert(ANYMAL, short, None).solve(*nearby(0))
    objective = solvers[0].stats()["iterations"]["obj"]
    assert objective[0] > 1.01 * objective[-1]
    assert solution.cost == pytest.approx(objective[-1], rel=1e-12)
    assert sum(solution.cost_terms.values()) == pytest.approx(objective[-1], rel=1e-12)
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


def test_phases_keep_their_durations(solved):
    _, solution = solved
    phases = np.diff(solution.trajectory.contact_times, axis=1)
    assert phases.min() > 0.2 - 1e-4
    assert phases[:, 1::2].max() < 0.7 + 1e-4
    assert not solution.window_active


def closest_by_foot(task, solution):
    """Distance of each foot's closest foothold to each line, (n lines, 4) in m."""
    chosen = np.moveaxis(solution.trajectory.footholds[:, 1:], 0, -2)
    distances = np.abs(signed_distance(task.obstacles_W[:, None, None], chosen))
    return distances.min(axis=1)


def careless(settings):
    """An expert to whom lines are nothing."""
    return Expert(ANYMAL, settings.model_copy(update={"obstacle_weight": 0.0}), None)


def test_every_foot_keeps_away_from_both_lines_only_if_told_to(solved_tasks, long_expert):
    other = careless(long_expert.settings)
    told = np.stack([closest_by_foot(case.task, case.solution) for case in solved_tasks])
    untold = np.stack(
        [closest_by_foot(case.task, other.solve(case.task, case.noise)) for case in solved_tasks]
    )
    assert told.shape == untold.shape == (3, 2, 4)
    assert (told.min(axis=(0, 1)) > 0.1).all()
    assert (untold.min(axis=(0, 1)) < 0.1).all()
    assert (told.mean(axis=(0, 1)) > untold.mean(axis=(0, 1)) + 0.05).all()


@pytest.mark.slow
def test_on_many_tasks_every_foot_keeps_away_from_both_lines(long_expert):
    other, told, untold = careless(long_expert.settings), [], []
    for index in range(20):
        task, noise = sample_paper_task(ANYMAL, index)
        told.append(closest_by_foot(task, long_expert.solve(task, noise)))
        untold.append(closest_by_foot(task, other.solve(task, noise)))
    near, near_untold = (np.mean(np.array(found) < 0.12, axis=(0, 1)) for found in (told, untold))
    assert np.min(told) > 0.05  # a replanner's close step
    assert near.max() < 0.1
    assert near_untold.min() > 0.3


def test_weights_are_not_compiled_in(short_expert, expert_cache, short):
    other = Expert(ANYMAL, short.model_copy(update={"obstacle_weight": 0.0}), expert_cache)
    assert short_expert.compiled, short_expert.build_report.reason
    assert other.build_report.cached


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


def test_running_out_of_time_is_a_status(expert_cache, nearby, short):
    hasty = short.model_copy(update={"solver": SolverSettings(time_limit=1e-6)})
    solution = Expert(ANYMAL, hasty, expert_cache).solve(*nearby(0))
    assert solution.status == Status.TIME_LIMIT, solution.message
    assert solution.iterations <= 1
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
    solve = InteriorPoint.solve

    def to_nowhere(self, start, parameters):
        return replace(solve(self, start, parameters), iterate=np.full_like(start, np.nan))

    monkeypatch.setattr(InteriorPoint, "solve", to_nowhere)
    solution = short_expert.solve(task, noise)
    np.testing.assert_array_equal(solution.trajectory.base_nodes, solution.guess.base_nodes)
    assert np.isfinite(solution.cost)


@pytest.fixture
def ctrl_c():
    """Sends a real SIGINT to this process soon after it is started."""
    before = signal.getsignal(signal.SIGINT)
    sender = threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT))
    yield sender
    sender.cancel()
    signal.signal(signal.SIGINT, before)


def test_ctrl_c_during_a_solve_interrupts_and_is_no_outcome(solved_tasks, long_expert, ctrl_c):
    signal.signal(signal.SIGINT, signal.default_int_handler)
    ctrl_c.start()
    with pytest.raises(KeyboardInterrupt):
        long_expert.solve(solved_tasks[0].task, solved_tasks[0].noise)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_interrupt_that_its_handler_lets_pass_leaves_the_solution_alone(
    solved_tasks, long_expert, ctrl_c
):
    received = []
    signal.signal(signal.SIGINT, lambda number, _: received.append(number))
    ctrl_c.start()
    first = solved_tasks[0]
    again = long_expert.solve(first.task, first.noise)
    assert received == [signal.SIGINT]
    assert again.status == Status.CONVERGED, again.message
    assert again.cost == first.solution.cost


def test_solves_outside_the_main_thread_leave_the_handler_alone(short_expert, nearby, monkeypatch):
    monkeypatch.setattr(signal, "signal", None)
    with ThreadPoolExecutor(1) as pool:
        solution = pool.submit(short_expert.solve, *nearby(0)).result()
    assert solution.status == Status.CONVERGED, solution.message


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
        ({"scope": {"duration": 0.3}}, "from 0.4 s up, got 0.3"),
        ({"scope": {"duration": 0.5}}, "leaves a cycle of"),
        ({"scope": {"duration": 2.7}}, r"3\.60 s in all, got 2\.7; raise it"),
        ({"scope": {"swing_share": 3.0}}, "swing_share 3.0; lower"),
        ({"scope": {"first_liftoff": 5.0}}, "leaves a cycle of -0.491"),
        ({"scope": {"first_liftoff": 0.1}}, "first_liftoff must lie between 0.3 and"),
        ({"scope": {"swing_share": 0.1}}, "nominal swing must lie between 0.25 and 0.7, got 0.115"),
        ({"scope": {"clearance": 0.02}}, "clearance must lie between 0.04 and 0.16, got 0.02"),
        ({"limits": {"stance": (2.0, 2.5)}}, r"15\.50 s in all, got 7\.5"),
        ({"limits": {"stance": (0.2, 0.5)}}, "nominal stance must lie between 0.2 and 0.5"),
        ({"limits": {"swing": (0.5, 0.2)}}, "must ascend"),
        ({"limits": {"force": 0.25}}, "must exceed 1/4 of the weight"),
        ({"obstacle_weight": float("nan")}, "obstacle_weight"),
        ({"weight": 1.0}, "Extra inputs"),
    ],
)
def test_settings_that_no_walk_can_meet_are_refused_when_made(wrong, message):
    with pytest.raises(ValidationError, match=message):
        ExpertSettings.model_validate(wrong)


@pytest.mark.parametrize(
    ("duration", "n_swings"), [(1.6, 1), (2.5, 2), (5.0, 4), (7.5, 6), (10.0, 8)]
)
def test_usual_scopes_are_possible(duration, n_swings):
    settings = ExpertSettings(scope=Scope(duration=duration, n_swings=n_swings))
    times = contact_times(settings.scope, (0, 1, 2, 3))
    assert (np.diff(times, axis=1) > 0.2 - 1e-9).all()


def test_a_base_below_the_ground_is_refused_by_name(short):
    deep = short.model_copy(update={"limits": Limits(height=0.42)})
    with pytest.raises(ConfigurationError, match=r"limits.height .* 'anymal', got 0.42 m"):
        Expert(ANYMAL, deep, None)
    with pytest.raises(ValidationError, match=r"'anymal': range_of_motion .* got 0.5 m"):
        RobotModel.model_validate({**ANYMAL.model_dump(), "range_of_motion": (0.16, 0.12, 0.5)})


def sample_paper_task(robot, index):
    """Task and noise number ``index`` of the data set with seed 0."""
    tasks, rng = TaskDistribution(), stream(0, Purpose.TASK, index)
    return sample_task(tasks, robot, rng), sample_noise(tasks, Scope().n_swings, rng)


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "n_tasks"), [(ANYMAL, 50), (HYQ, 20)], ids=["anymal", "hyq"])
def test_nearly_all_tasks_converge(robot, n_tasks, expert_cache):
    expert = Expert(robot, ExpertSettings(), expert_cache)
    assert expert.compiled, expert.build_report.reason
    solutions = [expert.solve(*sample_paper_task(robot, index)) for index in range(n_tasks)]
    converged = sum(solution.status == Status.CONVERGED for solution in solutions)
    assert converged >= 0.95 * n_tasks
