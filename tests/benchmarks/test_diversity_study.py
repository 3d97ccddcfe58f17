"""The study of diversity: what counts as one mode, and what is said of how modes differ."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from benchmarks.diversity import as_json
from benchmarks.solving.circumstances import circumstances
from benchmarks.solving.evidence import Evidence
from benchmarks.variety.character import character, differing
from benchmarks.variety.clusters import FOOTHOLD, TIMING, distances, modes
from benchmarks.variety.picture import contrasting, gallery, near_best, overview
from benchmarks.variety.solves import NUDGE, Kind, Study, Walk, judged, read, strict, write
from benchmarks.variety.summary import summarise, task_modes
from lmtr.errors import ConfigurationError, DataError
from lmtr.expert.initial_guess import initial_guess
from lmtr.expert.settings import ExpertSettings, Scope
from lmtr.quality.filter import QualityThresholds
from lmtr.quality.measure import measure
from lmtr.robot.model import ANYMAL
from lmtr.task.sampling import Noise, TaskDistribution
from lmtr.task.task import Task

SCOPE = Scope()
LINES = np.array([[0.8, 0.0, np.pi / 2.0], [1.9, 0.0, np.pi / 2.0]])
TASK = Task(np.zeros(3), ANYMAL.nominal_feet_B[:, :2], np.array([2.7, 0.0, 0.0]), LINES)
MADE = circumstances({}, 0, 2, compiled=True)
STUDY = Study(ANYMAL, TaskDistribution(), ExpertSettings(), 2, 3)
STILL = Noise(np.zeros((3, 3)), np.zeros((4, 2 * SCOPE.n_swings)), 0)
GUESS = initial_guess(TASK, STILL, ANYMAL, SCOPE).trajectory
FIGURES = measure(GUESS, ANYMAL, LINES).as_dict()


def walk(cost=1.0, draw=0, kind=Kind.DRAW, ahead=0.0, later=0.0, first=0, reasons=(), swaps=0):
    """A solution whose inner footholds lie ``ahead`` (m) and whose feet move ``later`` (s)."""
    noise = Noise(np.zeros((3, 3)), np.full((4, 2 * SCOPE.n_swings), later), first)
    trajectory = initial_guess(TASK, noise, ANYMAL, SCOPE).trajectory
    feet = initial_guess(TASK, replace(noise, timing=0.0 * noise.timing), ANYMAL, SCOPE)
    placed = feet.trajectory.footholds.copy()
    placed[:, 1:, 0] += ahead
    return Walk(
        kind=str(kind),
        index=0,
        draw=draw,
        iterations=30,
        cpu_s=0.3,
        reasons=reasons,
        first=first,
        liftoff_swaps=swaps,
        window_active=False,
        evidence=Evidence(TASK, "converged", cost, (), FIGURES),
        trajectory=replace(trajectory, footholds=placed),
    )


def test_distances_are_those_of_footholds_and_of_contact_times():
    apart, late = distances([walk(), walk(ahead=0.03), walk(later=-0.02)])
    np.testing.assert_allclose(apart, [[0.0, 0.03, 0.0], [0.03, 0.0, 0.03], [0.0, 0.03, 0.0]])
    np.testing.assert_allclose(late[0], [0.0, 0.0, 0.02], atol=1e-9)


def test_a_mode_is_no_wider_than_its_units_and_modes_are_ordered_by_cost():
    step = 0.4 * FOOTHOLD  # neighbours are near, but the ends are further apart than a mode is wide
    chain = [walk(cost=3.0 - 0.1 * k, ahead=k * step) for k in range(6)]
    label = modes(chain)
    apart, _ = distances(chain)
    assert label[-1] == 0
    assert len(set(label.tolist())) > 1
    for k in set(label.tolist()):
        assert apart[np.ix_(label == k, label == k)].max() <= FOOTHOLD


def test_times_alone_set_modes_apart():
    assert len(set(modes([walk(), walk(later=-0.9 * TIMING)]).tolist())) == 1
    assert len(set(modes([walk(later=0.6 * TIMING), walk(later=-0.6 * TIMING)]).tolist())) == 2
    assert modes([walk()]).tolist() == [0]
    assert len(set(modes([walk(), walk(ahead=0.01)], diameter=0.1).tolist())) == 2


def test_crossings_are_told_by_swing_step_and_foot():
    look = character(walk())
    feet = walk().trajectory.footholds[..., 0]
    for line, swings in zip(LINES[:, 0], look.crossing_swings, strict=True):
        for foot, swing in enumerate(swings):
            assert feet[foot, swing - 1] < line <= feet[foot, swing]
    assert look.between == int(((feet >= 0.8) & (feet < 1.9)).sum())
    landing = [
        walk().trajectory.touchdown_times[foot, swing - 1]
        for foot, swing in enumerate(look.crossing_swings[0])
    ]
    assert look.crossing_order[0][0] == ("LF", "RF", "LH", "RH")[int(np.argmin(landing))]
    assert look.crossing_steps[0] == pytest.approx(
        np.mean([feet[f, s] - feet[f, s - 1] for f, s in enumerate(look.crossing_swings[0])])
    )
    # The nominal walk has at most one foot up at a time, or two where swings overlap.
    assert 0.0 <= look.two_feet < 0.3


def test_differences_are_found_where_they_are_and_nowhere_else():
    usual = character(walk())
    assert not any(differing(usual, character(walk())).values())
    shifted = differing(usual, character(walk(ahead=0.3)))
    assert shifted["which swing crosses a line"]
    assert not shifted["order of lift-offs"]
    assert differing(usual, character(walk(first=1)))["order of lift-offs"]


@pytest.fixture
def walks():
    return [
        walk(1.0, 0, swaps=2),
        walk(1.02, 1, ahead=0.01),
        walk(1.05, 2, first=1),
        walk(1.5, 3, ahead=0.3),
        walk(0.5, 4, reasons=("obstacle",)),
        walk(1.0, 0, Kind.STRICT, ahead=0.02),
        walk(1.3, 0, Kind.NUDGED, ahead=0.3),
        walk(1.3, 0, Kind.NUDGED_STRICT, ahead=0.31),
    ]


def test_only_accepted_draws_make_modes(walks):
    (task,) = task_modes(walks)
    assert (task.solved, len(task.walks), task.count) == (5, 4, 3)
    assert task.label.tolist() == [0, 0, 1, 2]
    assert task.best == [0, 2, 3]
    assert near_best(task) == [0, 1]
    assert contrasting(task) == (0, 1)


def test_the_summary_counts_modes_costs_swaps_and_checks(walks):
    summary = summarise(walks, task_modes(walks))
    assert summary["solves"]["accepted"] == 0.8
    assert summary["solves"]["reasons"] == {"obstacle": 0.2}
    assert (summary["modes"]["median"], summary["modes"]["median_near_best"]) == (3.0, 2.0)
    assert summary["modes"]["median_share_of_largest"] == 0.5
    assert summary["costs"]["median_difference_within_modes"] == pytest.approx(0.02)
    assert summary["gait"]["solutions_with_another_order_than_the_guess"] == 0.25
    assert summary["checks"]["early_stop_to_optimum"]["same_mode"] == 1.0
    assert summary["checks"]["nudged"]["same_mode"] == 0.0
    assert summary["pairs_of_modes_that_differ_in"]["which swing crosses a line"] > 0.0
    assert [mode["size"] for mode in summary["tasks"][0]["modes"]] == [2, 1, 1]
    assert json.loads(as_json(summary))["tasks"] == summary["tasks"]


def test_pictures_show_the_modes(walks):
    tasks = task_modes(walks)
    titles = [axes.get_title(loc="left") for axes in gallery(tasks).axes]
    assert "Task 0: 2 of 3 modes, cost over the best" in titles
    assert sum(title.startswith("Mode") for title in titles) == 2
    assert overview(tasks).axes[0].get_title(loc="left") == "Median 3 modes per task"


def test_walks_are_kept_as_they_were(walks, tmp_path):
    write(tmp_path / "solves.json", MADE, walks)
    made, again = read(tmp_path / "solves.json")
    assert made == MADE
    assert [(w.kind, w.cost, w.first) for w in again] == [(w.kind, w.cost, w.first) for w in walks]
    np.testing.assert_array_equal(again[0].obstacles_W, LINES)
    np.testing.assert_allclose(
        again[3].trajectory.footholds, walks[3].trajectory.footholds, atol=1e-6
    )
    (tmp_path / "other.json").write_text(
        json.dumps({"circumstances": asdict(MADE), "solves": [{"kind": "draw"}]})
    )
    with pytest.raises(DataError, match="of another form"):
        read(tmp_path / "other.json")


def test_kept_walks_are_judged_by_the_present_thresholds():
    settings = ExpertSettings()
    walks = [walk(), replace(walk(), evidence=Evidence(TASK, "diverged", 1.0, ("tilt",), FIGURES))]
    lenient = QualityThresholds(obstacle_clearance=0.0, judge_cost=False)
    fine, failed = judged(walks, ANYMAL, settings, lenient)
    assert {"not_converged:diverged", "saturated:tilt"} <= set(failed.reasons)
    assert not {"not_converged:diverged", "saturated:tilt", "cost"} & set(fine.reasons)
    # Figures of a guess, whose feet come as near to lines as they like.
    (again,) = judged(walks[:1], ANYMAL, settings, QualityThresholds(obstacle_clearance=1.0))
    assert "obstacle" in again.reasons
    assert "obstacle" not in fine.reasons


def test_draws_share_their_task_and_a_nudge_is_small():
    (task, noise), (same, other) = STUDY.drawn(1, 0), STUDY.drawn(1, 1)
    np.testing.assert_array_equal(task.goal_pose_W, same.goal_pose_W)
    assert np.abs(noise.timing - other.timing).max() > 0.01
    _, nudged = STUDY.nudged(1, 0)
    assert nudged.first == noise.first
    assert 0.0 < np.abs(nudged.timing - noise.timing).max() < 10.0 * NUDGE * 0.1
    assert strict(STUDY.settings).cost_key(ANYMAL) == STUDY.settings.cost_key(ANYMAL)


def test_tasks_without_a_line_have_nothing_to_cross():
    with pytest.raises(ConfigurationError, match="needs a line to cross"):
        replace(STUDY, distribution=TaskDistribution(obstacle_count=(0, 2)))
