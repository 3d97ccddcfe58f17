"""The learning split: models learn from training solutions, and are tried on the others' starts."""

import numpy as np
import pytest

from lmtr.rollout import testbed
from lmtr.vectors.mirror import mirror_segment, mirror_task
from pipelines import evaluate
from pipelines.config import load
from pipelines.datasets import resolve
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


def test_each_segment_is_paired_with_a_task_of_its_own(data):
    for pairs in (data.training, data.validation):
        x, tau = pairs.x, pairs.tau
        # Both hold the base's height and the feet's positions at the epoch.
        np.testing.assert_allclose(x[:, HEIGHT_OF_TASK], tau[:, HEIGHT_OF_SEGMENT], atol=1e-6)


def test_rollouts_start_from_held_out_segments_and_plan_with_learnt_ones(
    workspace, tiny_config, dataset_id, data, monkeypatch
):
    config = load(str(tiny_config))
    starts, planned_with = [], []
    monkeypatch.setattr(
        evaluate, "run_rollouts", lambda planner, courses, given, *rest: starts.append(given) or []
    )
    monkeypatch.setattr(
        evaluate, "build_replanner", lambda model, pool, weights: planned_with.append(pool)
    )
