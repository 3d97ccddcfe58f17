"""Verdicts: each fault by its name, and the cost only beyond what the task explains."""

import re
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from lmtr.errors import DataError
from lmtr.expert.settings import CostWeights, ExpertSettings, Limits, Scope, SolverSettings
from lmtr.quality.cost_model import (
    DEFAULT_COST_MODEL,
    FEATURES,
    CostModel,
    fit_cost_model,
    task_features,
)
from lmtr.quality.filter import QualityThresholds, expected_cost, judge
from lmtr.quality.limits import Limit
from lmtr.quality.measure import Violations
from lmtr.quality.rules import REASONS, RULES, describe
from lmtr.robot.model import ANYMAL, HYQ
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import TaskDistribution, sample_task

LIMITS = QualityThresholds()
KEY = DEFAULT_COST_MODEL.cost_key
SOUND = Violations(
    linear_residual_peak=0.3,
    linear_residual_rms=0.1,
    angular_residual_peak=0.9,
    angular_residual_rms=0.3,
    drift=0.0013,
    stance_overshoot=0.001,
    swing_overshoot=0.003,
    friction_excess=0.0,
    pull=0.0,
    contact_change_force=0.0,
    force_peak=0.9,
    stance_slip=0.0,
    stance_height=0.0,
    swing_depth=0.0,
    fewest_feet_down=2,
    flight_time=0.0,
    support_least=0.8,
    sparse_support_time=0.9,
    stance_shortest=0.2,
    swing_shortest=0.2,
    swing_longest=0.5,
    height_deviation=0.05,
    tilt=0.13,
    vertical_speed=0.2,
    vertical_energy_swing=0.05,
    landing_force=0.15,
    landing_rate=2.5,
    landing_speed=0.1,
    closest_footholds=(0.18, 0.2),
)
FAULTS: dict[str, dict[str, object]] = {
    "linear_residual": {"linear_residual_peak": 4.0},
    "angular_residual": {"angular_residual_peak": 40.0},
    "drift": {"drift": 0.1},
    "stance_range_of_motion": {"stance_overshoot": 0.05},
    "swing_range_of_motion": {"swing_overshoot": 0.1},
    "friction": {"friction_excess": 0.05},
    "pull": {"pull": 0.05},
    "contact_change_force": {"contact_change_force": 0.1},
    "force_peak": {"force_peak": 2.5},
    "slip": {"stance_slip": 0.02},
    "off_ground": {"stance_height": 0.02},
    "below_ground": {"swing_depth": 0.03},
    "flight": {"flight_time": 0.2},
    "energetic_jumping": {"vertical_speed": 1.0, "vertical_energy_swing": 0.2},
    "hard_landing": {"landing_force": 2.0, "landing_rate": 20.0, "landing_speed": 0.9},
    "phase_too_short": {"swing_shortest": -0.1},
    "height": {"height_deviation": 0.3},
    "tilt": {"tilt": 0.9},
    "obstacle": {"closest_footholds": (0.3, 0.01)},
}


def verdict(
    violations=SOUND, status="converged", cost=3.0, expected=3.0, limits=LIMITS, saturated=()
):
    return judge(status, cost, expected, violations, limits, saturated)


def tasks(count, distribution=TaskDistribution()):  # noqa: B008 - frozen settings
    return [sample_task(distribution, ANYMAL, stream(3, Purpose.TASK, k)) for k in range(count)]


def test_a_sound_solution_is_accepted_without_reasons():
    assert verdict().accepted
    assert verdict().reasons == ()


@pytest.mark.parametrize("reason", FAULTS)
def test_each_fault_is_refused_by_its_name_alone(reason):
    refused = verdict(replace(SOUND, **FAULTS[reason]))
    assert not refused.accepted
    assert refused.reasons == (reason,)


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.figure)
def test_each_figure_is_judged_by_its_own_threshold(rule):
    limit = getattr(LIMITS, rule.threshold)
    beyond, within = (limit * (1.0 + sign * 0.01) for sign in (1, -1))
    if rule.at_least:
        beyond, within = within, beyond
    named = "closest_footholds" if rule.figure == "closest_foothold" else rule.figure
    for value, reasons in ((beyond, (rule.reason,)), (within, ()), (np.nan, (rule.reason,))):
        figure = (0.3, value) if named == "closest_footholds" else value
        assert verdict(replace(SOUND, **{named: figure})).reasons == reasons


def test_every_reason_is_tried_here_and_described():
    assert set(REASONS) == {*FAULTS, "cost", "not_converged", "saturated"}
    for reason in (*FAULTS, "cost", "not_converged:iteration_limit", "saturated:longest_swing"):
        assert describe(reason).endswith(".")
    assert "iteration limit" in describe("not_converged:iteration_limit")
    assert "longest swing" in describe("saturated:longest_swing")
    for unknown in ("bad_luck", "saturated", "not_converged", "tilt:left"):
        with pytest.raises(DataError, match=f"'{unknown}' is unknown"):
            describe(unknown)


def test_each_limit_that_a_solution_lies_on_is_a_reason_unless_tolerated():
    touched = ("height", "window")
    assert verdict(saturated=touched).reasons == ("saturated:height", "saturated:window")
    lenient = QualityThresholds(tolerated_limits=("window",))
    assert verdict(saturated=touched, limits=lenient).reasons == ("saturated:height",)
    assert verdict(saturated=("window",), limits=lenient).accepted


def test_only_limits_that_there_are_can_be_tolerated():
    known = ".*".join(re.escape(repr(limit.value)) for limit in Limit)
    with pytest.raises(ValidationError, match=rf"should be {known}.*'windows'"):
        QualityThresholds(tolerated_limits=("windows",))
    everything = QualityThresholds(tolerated_limits=tuple(Limit))
    assert QualityThresholds.model_validate_json(everything.model_dump_json()) == everything
    assert verdict(saturated=[limit.value for limit in Limit], limits=everything).accepted


def test_all_reasons_are_given_the_status_first():
    refused = verdict(replace(SOUND, pull=1.0, tilt=2.0), status="iteration_limit", cost=99.0)
    assert refused.reasons == ("not_converged:iteration_limit", "pull", "tilt", "cost")


def test_what_is_not_a_number_is_refused():
    assert verdict(replace(SOUND, drift=np.nan)).reasons == ("drift",)
    assert verdict(cost=np.nan, expected=None).reasons == ("cost",)


def test_cost_is_judged_against_the_task_only():
    limit = 1.0 + LIMITS.cost_excess
    assert verdict(cost=5.0 * limit - 0.01, expected=5.0).accepted
    assert verdict(cost=5.0 * limit + 0.01, expected=5.0).reasons == ("cost",)
    assert verdict(cost=1000.0, expected=None).accepted


def test_costs_of_easy_tasks_may_spread_as_widely_as_those_of_usual_ones():
    allowed = LIMITS.cost_excess * LIMITS.cost_model.typical
    assert verdict(cost=1.0 + allowed - 0.01, expected=1.0).accepted
    assert verdict(cost=1.0 + allowed + 0.01, expected=1.0).reasons == ("cost",)


def test_thresholds_can_be_moved_and_are_checked():
    strict = QualityThresholds(drift=0.001)
    assert verdict(limits=strict).reasons == ("drift",)
    with pytest.raises(ValidationError):
        QualityThresholds(drift=-1.0)
    with pytest.raises(ValidationError):
        QualityThresholds(drfit=1.0)


def test_further_goals_are_expected_to_be_dearer():
    near, far = (
        tasks(1, TaskDistribution(goal_distance=(d, d), goal_lateral=0.0))[0] for d in (2.3, 3.1)
    )
    cheap, dear = (expected_cost(task, ANYMAL, KEY, LIMITS) for task in (near, far))
    assert dear > cheap > 0.0


def test_nothing_is_expected_of_another_robot_or_when_cost_is_not_judged():
    task = tasks(1)[0]
    assert expected_cost(task, HYQ, ExpertSettings().cost_key(HYQ), LIMITS) is None
    assert expected_cost(task, ANYMAL, KEY, QualityThresholds(judge_cost=False)) is None


def test_the_default_costs_are_those_that_the_model_was_fitted_for():
    assert ExpertSettings().cost_key(ANYMAL) == KEY
    same = ExpertSettings(solver=SolverSettings(max_iterations=300)).cost_key(ANYMAL)
    assert expected_cost(tasks(1)[0], ANYMAL, same, LIMITS) > 0.0


def test_a_robot_is_known_by_its_figures_and_not_by_its_name():
    renamed = ANYMAL.model_copy(update={"name": "anymal_c"})
    assert ExpertSettings().cost_key(renamed) == KEY
    others = {
        "mass": 35.0,
        "moments": (1.0, 2.0, 2.0),
        "products": (0.0, 0.0, 0.0),
        "nominal_forward": 0.36,
        "nominal_lateral": 0.2,
        "nominal_height": 0.45,
        "range_of_motion": (0.15, 0.12, 0.1),
        "friction": 0.5,
    }
    assert {"name", *others} == set(type(ANYMAL).model_fields)
    changed = [ANYMAL.model_copy(update={name: value}) for name, value in others.items()]
    keys = {ExpertSettings().cost_key(robot) for robot in changed}
    assert len(keys - {KEY}) == len(others)


@pytest.mark.parametrize(
    "other",
    [
        *({"costs": CostWeights(**{name: 0.1})} for name in CostWeights.model_fields),
        {"obstacle_weight": 0.0},
        {"obstacle_sigma": 0.2},
        {"scope": Scope(duration=10.0, n_swings=6)},
        {"scope": Scope(n_swings=5)},
        {"limits": Limits(force=1.4)},
        {"range_of_motion_margin": 0.02},
        {"range_of_motion_step": 0.1},
    ],
    ids=repr,
)
def test_a_cost_of_another_kind_is_left_unjudged(other):
    key = ExpertSettings(**other).cost_key(ANYMAL)
    assert key != KEY
    expected = expected_cost(tasks(1)[0], ANYMAL, key, LIMITS)
    assert expected is None
    assert verdict(cost=1000.0, expected=expected).accepted


def test_features_are_those_of_the_task():
    task = replace(
        tasks(1)[0],
        start_pose_W=np.array([1.0, 1.0, np.pi / 2.0]),
        goal_pose_W=np.array([0.7, 3.0, np.pi / 2.0 + 0.2]),
        obstacles_W=np.zeros((3, 3)),
    )
    feet = ANYMAL.nominal_feet_B[:, :2] + np.array([0.03, 0.04])
    task = replace(task, start_feet_W=np.stack([1.0 - feet[:, 1], 1.0 + feet[:, 0]], axis=-1))
    features = dict(zip(FEATURES, task_features(task, ANYMAL), strict=True))
    expected = {
        "distance_fourth": (2.0**2 + 0.3**2) ** 2,
        "lateral": 0.3,
        "yaw": 0.2,
        "lines": 3.0,
        "scatter": 0.05,
    }
    assert features == pytest.approx(expected)


def test_the_fit_finds_planted_coefficients_despite_bad_solutions():
    slopes = dict(zip(FEATURES, (1.1, 0.2, 0.0, 0.3, 2.0), strict=True))
    true = CostModel(robot="anymal", cost_key="key", typical=1.0, intercept=0.3, **slopes)
    features = np.random.default_rng(4).uniform(0.0, 3.0, (200, len(FEATURES)))
    costs = true.predict(features) + 0.01 * np.random.default_rng(5).normal(size=200)
    costs[::15] += 6.0  # poor local optima, seven in a hundred
    fitted = fit_cost_model(features, costs, "anymal", "key")
    assert (fitted.robot, fitted.cost_key) == ("anymal", "key")
    for name in ("intercept", *FEATURES):
        assert getattr(fitted, name) == pytest.approx(getattr(true, name), abs=0.02), name


def test_too_few_solves_expect_nothing():
    assert fit_cost_model(np.ones((10, len(FEATURES))), np.ones(10), "anymal", "key") is None


def test_a_fit_to_broken_data_is_refused():
    with pytest.raises(DataError, match="shape"):
        fit_cost_model(np.ones((10, 2)), np.ones(10), "anymal", "key")
    with pytest.raises(DataError, match="finite"):
        fit_cost_model(np.ones((2, len(FEATURES))), np.array([1.0, np.nan]), "anymal", "key")
