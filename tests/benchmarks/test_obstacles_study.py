"""The study of footholds beside lines compares like with like, and counts as it says."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest

from benchmarks.footholds.families import (
    BOXES,
    COMPARED,
    FAMILIES,
    NONE,
    USED,
    called,
    groups,
    in_box,
    of_family,
)
from benchmarks.footholds.picture import box_picture, foothold_picture
from benchmarks.footholds.solves import LIMIT, Walk, read, write
from benchmarks.footholds.summary import goal_stance_apart, paired_cost, summarise
from benchmarks.footholds.tables import tables
from benchmarks.kept import read_rows, write_rows
from benchmarks.obstacles import require_all
from benchmarks.solving.circumstances import circumstances
from benchmarks.solving.evidence import Evidence
from lmtr.errors import DataError
from lmtr.robot.model import ANYMAL
from lmtr.task.sampling import TaskDistribution
from lmtr.task.task import Task

N_SWINGS = 3
MADE = circumstances({}, 0, 10, compiled=True)


def walk(group, index=0, apart=None, status="converged", cost=3.0, distance=2.5, **changes):
    apart = np.full((2, 4, N_SWINGS), 0.3) if apart is None else apart
    task = Task(
        start_pose_W=np.zeros(3),
        start_feet_W=ANYMAL.nominal_feet_B[:, :2],
        goal_pose_W=np.array([distance, 0.0, 0.0]),
        obstacles_W=np.array([[1.0, 0.0, np.pi / 2]]),
    )
    evidence = Evidence(task, status, cost, (), {})
    sound = Walk(group, index, 40, 0.4, (), evidence, apart, 0.15, 0.0, 0.002, True)
    return replace(sound, **changes)


def walks_of_all_groups():
    """Ten walks of each group; walkers that know of no line step on them, wide boxes exceed."""
    found = []
    for group in groups():
        lines = group.tasks.obstacle_count[0]
        near = 0.02 if group.settings.obstacle_weight == 0.0 else 0.2
        box = group.robot.range_of_motion[0]
        found += [
            walk(
                group.name,
                index,
                apart=np.full((lines, 4, N_SWINGS), near + 0.01 * index),
                distance=group.tasks.goal_distance[0] + 0.05 * index,
                reach=box + 0.001 * (index + 1),
                cost=1.0 / box,
            )
            for index in range(10)
        ]
    return found


def test_groups_of_a_family_differ_in_the_potential_alone():
    by_name = {group.name: group for group in groups()}
    assert len(by_name) == len(list(groups()))
    for family in FAMILIES:
        blind, seeing = by_name[of_family(family, NONE)], by_name[of_family(family, USED)]
        assert blind.settings.obstacle_weight == 0.0
        assert blind.tasks == seeing.tasks
        assert blind.robot == seeing.robot
        changed = {"obstacle_weight": seeing.settings.obstacle_weight}
        assert blind.settings.model_copy(update=changed) == seeing.settings
    assert [by_name[in_box(box, "near")].robot.range_of_motion[0] for box in BOXES] == list(BOXES)


def test_rows_come_back_under_their_head(tmp_path):
    path = tmp_path / "rows.json"
    rows = [{"a": 1, "b": [0.5, None]}, {"a": 2, "b": []}]
    write_rows(path, {"key": "k", "more": {"x": 1}}, rows)
    assert read_rows(path, "study") == ({"key": "k", "more": {"x": 1}}, rows)
    write_rows(path, {}, [])
    assert read_rows(path, "study") == ({}, [])
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("content", ["no JSON", "[1]", '{"key": "k"}'])
def test_a_damaged_file_of_rows_is_refused_with_its_path(tmp_path, content):
    path = tmp_path / "rows.json"
    path.write_text(content)
    with pytest.raises(DataError, match=r"study: .*rows\.json.*solve"):
        read_rows(path, "study")


def test_walks_come_back_unless_their_group_has_changed(tmp_path):
    path = tmp_path / "solves.json"
    first, second, *_ = groups()
    apart = np.linspace(-1.0, 1.0, 2 * 4 * N_SWINGS).reshape(2, 4, N_SWINGS)
    kept = [walk(first.name, apart=apart, reasons=("obstacle",)), walk(second.name)]
    write(path, MADE, [first, second], kept)
    made, back = read(path, [first, second])
    assert made == MADE
    assert [w.group for w in back] == [first.name, second.name]
    assert back[0].reasons == ()  # verdicts are not kept
    assert (back[0].cost, back[0].distance) == (3.0, 2.5)
    np.testing.assert_allclose(back[0].apart, apart, atol=5e-5)
    other = replace(second, tasks=TaskDistribution(goal_lateral=0.1))
    assert [w.group for w in read(path, [first, other])[1]] == [first.name]


def test_drawing_asks_for_groups_that_are_missing():
    compared = list(groups())
    with pytest.raises(DataError, match=r"two lines; potential none.*--resume"):
        require_all([walk(group.name) for group in compared[1:]], compared)
    require_all([walk(group.name) for group in compared], compared)


def test_close_pairs_and_footholds_are_counted_by_line_and_foot():
    """One foot of eight pairs is 2 cm before the second line; another 8 cm beyond the first."""
    apart = np.full((2, 4, N_SWINGS), 0.5)
    apart[1, 2, 0] = -0.02
    apart[0, 3, 1] = 0.08
    seen = of_family("two lines", USED)
    walks = [w for w in walks_of_all_groups() if w.group != seen]
    walks += [walk(seen, 0, apart=apart, reasons=("obstacle",)), walk(seen, 1, status="diverged")]
    found = summarise(walks, drawn=1)["families"]["two lines"][called(USED)]
    assert found["converged"] == pytest.approx(0.5)
    assert found["accepted"] == pytest.approx(0.5)
    assert found["reasons"] == {"obstacle": 1}
    assert found["closest_foothold"]["median"] == pytest.approx(0.02)
    assert found["pairs_close"] == pytest.approx({"0.05": 1 / 8, "0.1": 2 / 8})
    assert found["footholds_close"] == pytest.approx(
        {"0.05": 1 / (4 * N_SWINGS), "0.1": 2 / (4 * N_SWINGS)}
    )
    assert found["close_by_line"] == pytest.approx([1 / 4, 1 / 4])
    assert found["close_by_foot"] == pytest.approx({"LF": 0, "RF": 0, "LH": 1 / 2, "RH": 1 / 2})
    assert found["hind_foot_left"] == 0.0


def test_a_hind_foot_that_ends_before_a_line_was_left_behind():
    apart = np.full((2, 4, N_SWINGS), 0.5)
    apart[1, 3, -1] = -0.3
    seen = of_family("four lines", USED)
    walks = [w for w in walks_of_all_groups() if w.group != seen]
    walks += [walk(seen, 0, apart=apart, reasons=("cost",)), walk(seen, 1), walk(seen, 2)]
    found = summarise(walks, drawn=1)["families"]["four lines"][called(USED)]
    assert found["hind_foot_left"] == pytest.approx(1 / 3)
    assert found["accepted_of_these"] == 0.0


@pytest.mark.parametrize(
    ("ahead", "signs"), [(1.0, [1, 1, 1, 1]), (2.0, [1, 1, -1, -1]), (3.0, [-1, -1, -1, -1])]
)
def test_feet_at_the_goal_are_beyond_lines_that_lie_before_them(ahead, signs):
    task = Task(
        start_pose_W=np.zeros(3),
        start_feet_W=ANYMAL.nominal_feet_B[:, :2],
        goal_pose_W=np.array([2.0, 0.0, 0.0]),
        obstacles_W=np.array([[ahead, 0.0, np.pi / 2]]),
    )
    assert np.sign(goal_stance_apart(task)).tolist() == [signs]


def test_costs_are_compared_on_tasks_that_both_converged_on():
    ours = [walk("a", 0, cost=2.0), walk("a", 1, cost=9.0, status="diverged"), walk("a", 2)]
    theirs = [walk("b", 0, cost=1.0), walk("b", 1, cost=1.0), walk("b", 2, status="diverged")]
    assert paired_cost(ours, theirs) == pytest.approx(2.0)


def test_reach_beyond_the_limit_of_replanners_is_told_by_box():
    found = summarise(walks_of_all_groups(), drawn=1)["boxes"]
    tight, wide = found["0.16"]["near"], found["0.2"]["near"]
    assert tight["share_beyond_limit"] == 0.0
    assert wide["share_beyond_limit"] == 1.0
    assert wide["beyond_limit"]["largest"] == pytest.approx(0.2 + 0.01 - LIMIT)
    assert wide["cost_ratio"] == pytest.approx(0.16 / 0.2)
    assert sum(each["tasks"] for each in found["0.16"]["by_distance"]) == 20


def test_tables_and_pictures_show_every_group():
    walks = walks_of_all_groups()
    summary = summarise(walks, drawn=5)
    shown = list(tables(summary))
    assert shown[0].row_count == 2 * len(FAMILIES) + len(COMPARED) * (
        len(summary["families"][COMPARED[0]]) - 2
    )
    assert shown[3].row_count == 2 * len(BOXES)
    for picture in (foothold_picture(walks, summary), box_picture(summary)):
        assert all(axes.has_data() for axes in picture.axes)
        plt.close(picture)
