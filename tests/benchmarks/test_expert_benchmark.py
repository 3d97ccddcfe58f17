"""The expert's benchmark: what it computes from rows, what it keeps, and a run of it."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.solving.circumstances import (
    Circumstances,
    differences,
)
from benchmarks.solving.figures import FIGURES, GOALS, Figure, summarise
from benchmarks.solving.lanes import HERE, BenchmarkError, Contender, Worker
from benchmarks.solving.pairs import compare, paired_ratio
from benchmarks.solving.record import (
    Result,
    has_worsened,
    ratio,
    read_record,
    write_record,
)
from benchmarks.solving.rows import count_reasons
from benchmarks.solving.worker import configuration
from lmtr.errors import ConfigurationError, DataError
from lmtr.robot.model import ANYMAL

CIRCUMSTANCES = Circumstances(
    code="1+abc",
    sources="0123abcd",
    day="2026-11-01",
    processor="a processor",
    casadi="3.8",
    compiled=True,
    tasks=2,
    seed=0,
    settings={"robot": "r"},
)


def figure(key: str) -> Figure:
    return next(figure for figure in FIGURES if figure.key == key)


def row(cpu_s: float, iterations: int = 10, **columns) -> dict:
    defaults = {"converged": True, "accepted": True, "cost": 1.0, "reasons": []}
    return {"cpu_s": cpu_s, "iterations": iterations, **defaults, **columns}


def test_every_goal_belongs_to_a_figure_and_every_figure_to_one_line():
    keys = [figure.key for figure in FIGURES]
    assert len(set(keys)) == len(keys)
    assert set(GOALS) <= set(keys)


def test_summary_of_rows_worked_out_by_hand():
    rows = [
        row(1.0, 10, stance_overshoot=0.004, drift=0.001, liftoff_swaps=0),
        row(2.0, 40, stance_overshoot=0.008, drift=0.002, liftoff_swaps=3),
        # Refused, so it costs time and counts in residuals but leaves the overshoots alone.
        row(3.0, 20, stance_overshoot=0.5, drift=0.009, liftoff_swaps=0, accepted=False),
        row(4.0, 200, drift=9.0, liftoff_swaps=1, accepted=False, converged=False),
    ]
    found = summarise(rows, setup_s=7.0)
    assert found["cpu_s"] == pytest.approx(2.5)
    assert found["cpu_s_per_accepted"] == pytest.approx(10.0 / 2)
    assert found["cpu_s_accepted"] == pytest.approx(1.5)
    assert found["cpu_s_per_iteration"] == pytest.approx((0.05 + 0.1) / 2)
    assert found["converged"] == pytest.approx(0.75)
    assert found["accepted"] == pytest.approx(0.5)
    assert found["stance_overshoot_max"] == pytest.approx(0.008)
    assert found["drift"] == pytest.approx(0.002)
    assert found["liftoff_swaps"] == pytest.approx(1.0)
    assert found["any_swap"] == pytest.approx(0.5)
    assert found["setup_s"] == 7.0
    assert np.isnan(found["closest_foothold"])


def test_nothing_accepted_leaves_no_figure_of_accepted_solutions():
    found = summarise([row(1.0, accepted=False, stance_overshoot=0.1)], setup_s=np.nan)
    assert found["accepted"] == 0.0
    assert np.isnan(found["cpu_s_per_accepted"])
    assert np.isnan(found["stance_overshoot_max"])
    assert figure("stance_overshoot_max").reaches(np.nan, 0.01) is None


@pytest.mark.parametrize(
    ("key", "good", "bad"),
    [("cpu_s", 0.5, 0.51), ("converged", 0.98, 0.97), ("accepted", 0.7, 0.95)],
)
def test_goals_are_reached_from_their_better_side(key, good, bad):
    target = figure(key).goal.target
    assert figure(key).reaches(good, target) is True
    assert figure(key).reaches(bad, target) is False


def test_a_change_for_the_worse_is_told_from_one_for_the_better():
    assert has_worsened(figure("cpu_s"), 1.2) is True
    assert has_worsened(figure("cpu_s"), 0.8) is False
    assert has_worsened(figure("converged"), 0.8) is True
    assert has_worsened(figure("cpu_s"), 1.01) is None
    assert has_worsened(figure("accepted"), 0.5) is None
    assert has_worsened(figure("cpu_s"), np.nan) is None


def test_ratio_to_the_record():
    assert ratio({"cpu_s": 0.3}, {"cpu_s": 0.6}, figure("cpu_s")) == pytest.approx(0.5)
    assert np.isnan(ratio({"pull": 0.1}, {"pull": 0.0}, figure("pull")))
    # A figure that the record does not know yet.
    assert np.isnan(ratio({"pull": 0.1}, {}, figure("pull")))


def test_a_record_is_read_back_and_keeps_those_of_other_robots(tmp_path):
    path = tmp_path / "results" / "expert.json"
    assert read_record("anymal", path) is None
    first = Result(CIRCUMSTANCES, {"cpu_s": 0.123456, "setup_s": np.nan})
    write_record("anymal", first, path)
    write_record("hyq", Result(CIRCUMSTANCES, {"cpu_s": 9.0}), path)
    kept = read_record("anymal", path)
    assert kept.circumstances == CIRCUMSTANCES
    assert kept.summary["cpu_s"] == pytest.approx(0.1235)
    assert np.isnan(kept.summary["setup_s"])
    assert read_record("hyq", path).summary == {"cpu_s": 9.0}


@pytest.mark.parametrize("content", ["no JSON", "[1]", '{"anymal": {"summary": {}}}'])
def test_a_damaged_record_is_refused_with_its_path(tmp_path, content):
    path = tmp_path / "expert.json"
    path.write_text(content)
    with pytest.raises(DataError, match=r"expert\.json"):
        read_record("anymal", path)


def test_what_makes_results_hard_to_compare_is_said():
    assert differences(CIRCUMSTANCES, CIRCUMSTANCES) == []
    other = replace(CIRCUMSTANCES, processor="another", tasks=9, settings={"robot": "x"})
    said = " ".join(differences(CIRCUMSTANCES, other))
    assert "another machine" in said
    assert "9 tasks" in said
    assert "robot" in said


@given(
    theirs=st.lists(st.floats(0.1, 10.0), min_size=1, max_size=30),
    factor=st.floats(0.2, 5.0),
)
def test_a_constant_factor_is_found_whatever_the_tasks_are(theirs, factor):
    other = np.array(theirs)
    found = paired_ratio(factor * other, other, seed=1)
    assert [found.low, found.median, found.high] == pytest.approx([factor] * 3)
    assert found.pairs == len(theirs)


def test_the_interval_covers_the_true_ratio_about_as_often_as_it_says():
    rng = np.random.default_rng(0)
    noise = rng.lognormal(sigma=0.2, size=(200, 40))
    found = [paired_ratio(1.5 * draw, np.ones(40), seed=k) for k, draw in enumerate(noise)]
    covered = np.mean([f.low <= 1.5 <= f.high for f in found])
    assert 0.88 < covered < 0.99


def test_only_solves_that_both_converged_on_compare_iterations_and_costs():
    ours = [row(1.0, 10, cost=2.0), row(1.0, 200, converged=False), row(1.0, 10, cost=2.0)]
    theirs = [row(2.0, 40, cost=1.0), row(4.0, 10), row(2.0, 40, cost=1.0)]
    found = compare(ours, theirs, seed=0, same_costs=True)
    assert found["CPU"].pairs == 3
    assert found["iterations, both converged"].pairs == 2
    assert found["iterations, both converged"].median == pytest.approx(0.25)
    assert found["cost, both converged"].median == pytest.approx(2.0)
    assert "cost, both converged" not in compare(ours, theirs, seed=0, same_costs=False)
    none = compare(ours[1:2], theirs[1:2], seed=0, same_costs=True)["iterations, both converged"]
    assert none.pairs == 0
    assert np.isnan(none.median)


def test_reasons_are_counted_in_all_and_alone():
    rows = [row(1.0, reasons=reasons) for reasons in (["flight"], ["cost", "flight"], ["cost"], [])]
    rows.append(row(1.0, reasons=["flight"]))
    assert list(count_reasons(rows).items()) == [("flight", (3, 2)), ("cost", (2, 1))]


def test_one_figure_of_a_named_robot_can_be_overridden():
    box = (0.2, 0.12, 0.1)
    config = configuration(
        None, ["dataset.robot.range_of_motion=[0.2, 0.12, 0.1]", "expert.obstacle_weight=0"]
    )
    assert config.dataset.robot == ANYMAL.model_copy(update={"range_of_motion": box})
    assert config.expert.obstacle_weight == 0.0
    with pytest.raises(ConfigurationError, match="range_of_movement"):
        configuration(None, ["dataset.robot.range_of_movement=1"])


def test_a_folder_without_the_code_is_no_contender(tmp_path):
    with pytest.raises(BenchmarkError, match="root folder of a checkout"):
        Worker(Contender(tmp_path, None, ()), tmp_path)


@pytest.mark.slow
def test_two_experts_solve_the_same_two_tasks(tmp_path):
    out = tmp_path / "expert.json"
    settings = ["--against-set", "expert.obstacle_weight=0", "--tasks", "2", "--out", str(out)]
    command = [sys.executable, str(HERE / "benchmarks" / "expert.py"), *settings]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path)
    assert "CPU per solve" in done.stdout
    written = json.loads(out.read_text())
    (other,) = written["others"]
    assert [len(written["rows"]), len(other["rows"])] == [2, 2]
    for ours, theirs in zip(written["rows"], other["rows"], strict=True):
        assert ours["converged"]
        assert theirs["converged"]
        assert ours["cost"] != theirs["cost"]
        assert ours["closest_foothold"] > 0.05
    assert other["ratios"]["CPU"]["pairs"] == 2
