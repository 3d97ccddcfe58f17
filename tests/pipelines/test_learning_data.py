"""The learning split: models learn from training solutions, and are tried on the others' starts."""

import numpy as np
import pytest

from lmtr.replanners.build import build_replanner
from lmtr.rollout.testbed import run_rollouts
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT
from lmtr.vectors.mirror import mirror_segment, mirror_task
from pipelines import rollout_worker, trials
from pipelines.config import load
from pipelines.datasets import configuration_of, resolve
from pipelines.learning_data import learning_data
from pipelines.workspace import Workspace

WHOLE_ORDER = "solution_index, epoch_s, goal_time_s"


@pytest.fixture(scope="module")
def workspace(tiny_home):
    return Workspace.open(tiny_home, create=False)


@pytest.fixture(scope="module")
def dataset_id(workspace):
    return resolve(workspace, None)


@pytest.fixture(scope="module")
def data(workspace, tiny_config, dataset_id):
    return learning_data(load(str(tiny_config)), workspace, dataset_id)


@pytest.fixture(scope="module")
def stored(workspace, dataset_id):
    """(x, τ) of the lake's rows by split, read row by row."""
    rows = workspace.lake.read(
        "segments", where=f"dataset_id = '{dataset_id}'", order_by=WHOLE_ORDER
    ).to_pylist()
    assert {row["split"] for row in rows} == {"train", "validation"}

    def of(split):
        mine = [row for row in rows if row["split"] == split]
        return tuple(np.array([row[name] for row in mine], dtype=float) for name in ("x", "tau"))

    return {split: of(split) for split in ("train", "validation")}


def test_training_rows_are_the_training_solutions_and_then_their_mirror_images(data, stored):
    x, tau = stored["train"]
    count = len(x)
    assert data.training.x.shape == (2 * count, 35)
    assert data.training.tau.shape == (2 * count, 264)
    np.testing.assert_array_equal(data.training.x[:count], x)
    np.testing.assert_array_equal(data.training.tau[:count], tau)
    np.testing.assert_array_equal(data.training.x[count:], mirror_task(x))
    np.testing.assert_array_equal(data.training.tau[count:], mirror_segment(tau))


def test_without_the_mirror_only_the_solutions_themselves_are_learnt(
    workspace, tiny_config, dataset_id, stored
):
    config = load(str(tiny_config), ["training.mirror=false"])
    training = learning_data(config, workspace, dataset_id).training
    np.testing.assert_array_equal(training.x, stored["train"][0])
    np.testing.assert_array_equal(training.tau, stored["train"][1])


def test_fewer_segments_are_a_part_of_more_and_of_all_solutions(
    workspace, tiny_config, dataset_id, stored
):
    def drawn(count):
        overrides = [f"training.segments={count}", "training.mirror=false"]
        return learning_data(load(str(tiny_config), overrides), workspace, dataset_id)

    rows = [row.tobytes() for row in stored["train"][0]]
    few, more = (drawn(count) for count in (len(rows) // 4, len(rows) // 2))
    places = [[rows.index(row.tobytes()) for row in each.training.x] for each in (few, more)]
    assert [len(each) for each in places] == [len(rows) // 4, len(rows) // 2]
    assert set(places[0]) < set(places[1])
    assert places[1] == sorted(places[1])  # pairs stay pairs, in the order of the lake
    np.testing.assert_array_equal(more.training.tau, stored["train"][1][places[1]])
    assert max(places[0]) - min(places[0]) > len(rows) // 2
    assert few.identity != more.identity
    assert len(few.validation.x) == len(stored["validation"][0])
    assert len(drawn(10 * len(rows)).training.x) == len(rows)


def test_validation_rows_are_those_of_held_out_solutions_unmirrored(data, stored):
    np.testing.assert_array_equal(data.validation.x, stored["validation"][0])
    np.testing.assert_array_equal(data.validation.tau, stored["validation"][1])


def test_no_held_out_row_nor_its_mirror_image_is_learnt(data, stored):
    x, tau = stored["validation"]
    assert nearest(x, data.training.x) > 1e-3
    assert nearest(mirror_task(x), data.training.x) > 1e-3
    assert nearest(tau, data.training.tau) > 1e-3
    assert nearest(mirror_segment(tau), data.training.tau) > 1e-3


def nearest(rows, others):
    """Least distance, in the largest number, of any of the rows (N, D) to any other (M, D)."""
    return min(np.abs(others - row).max(axis=1).min() for row in rows)


def test_each_task_describes_the_robot_at_the_start_of_its_segment(data):
    for pairs in (data.training, data.validation):
        x, tau = TASK_LAYOUT.unpack(pairs.x), SEGMENT_LAYOUT.unpack(pairs.tau)
        now = tau["base_nodes"][:, 0, 0]
        np.testing.assert_allclose(x["height"], now[:, 2], rtol=0.0, atol=1e-6)
        np.testing.assert_allclose(x["roll_pitch"], now[:, 3:5], rtol=0.0, atol=1e-6)
        # Mirrored one without the other, the roll would miss by twice its size.
        assert np.abs(x["roll_pitch"][:, 0]).max() > 1e-3


def test_rollouts_start_from_held_out_segments_and_look_up_learnt_ones(
    workspace, tiny_config, dataset_id, data, monkeypatch
):
    config = load(str(tiny_config), ["evaluation.rollouts=8", "evaluation.rollout.duration=0.3"])
    robot = configuration_of(workspace, dataset_id).dataset.robot
    given, looked_up = [], []

    def run(replanner, courses, starts, *rest):
        given.append(starts)
        return run_rollouts(replanner, courses, starts, *rest)

    def build(model, library, weights, **choices):
        looked_up.append(library)
        return build_replanner(model, library, weights, **choices)

    monkeypatch.setattr(rollout_worker, "run_rollouts", run)
    monkeypatch.setattr(trials, "build_replanner", build)
    (trial,) = trials.trials(config.evaluation, data, [])  # the trajectory library
    tried = rollout_worker.RolloutWorker(data, {}, robot, config.evaluation)(trial)
    assert len(tried.rows) == 8
    (starts,), (library,) = given, looked_up
    held_out = {row.tobytes() for row in data.validation.tau}
    assert starts.shape == (8, 264)
    assert {row.tobytes() for row in starts} <= held_out
    assert len({row.tobytes() for row in starts}) > 1
    np.testing.assert_array_equal(library.x, data.training.x)
    np.testing.assert_array_equal(library.tau, data.training.tau)
