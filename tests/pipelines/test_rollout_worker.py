"""What a trial gives does not depend on what is rolled out beside it."""

import pytest

from pipelines.config import load
from pipelines.datasets import configuration_of, resolve
from pipelines.learning_data import learning_data
from pipelines.registry import load as load_model
from pipelines.registry import models
from pipelines.rollout_worker import RolloutWorker
from pipelines.trials import trials
from pipelines.workspace import Workspace


@pytest.fixture(scope="module")
def tried(tiny_home, tiny_config):
    """Rolls out all replanners of the tiny home with other settings; rows by label."""
    workspace = Workspace.open(tiny_home, create=False)
    dataset_id = resolve(workspace, None)
    config = load(str(tiny_config))
    data = learning_data(config, workspace, dataset_id)
    known = models(workspace, data.dataset_id, data.segmentation_id)
    loaded = {model.model_id: load_model(workspace, model.model_id) for model in known}
    robot = configuration_of(workspace, dataset_id).dataset.robot

    def roll_out(*changes):
        section = load(str(tiny_config), list(changes)).evaluation
        worker = RolloutWorker(data, loaded, robot, section)
        return {trial.label: worker(trial) for trial in trials(section, data, known)}

    return roll_out


def test_a_rollout_is_the_same_alone_and_in_a_batch(tried):
    alone, batch = tried("evaluation.rollouts=1"), tried("evaluation.rollouts=6")
    assert len(alone) == 3
    for label, one in alone.items():
        row, same = one.rows[0], batch[label].rows[0]
        assert same["obstacles"] == row["obstacles"]
        for name, value in row["metrics"]:
            # Products of matrices of another size differ in their last digits.
            assert dict(same["metrics"])[name] == pytest.approx(value, rel=1e-6, abs=1e-9), name


def test_motions_are_kept_of_those_that_reached_their_end_first(tried):
    # A tilt that walking passes makes some of the rollouts end early.
    found = tried(
        "evaluation.rollouts=8",
        "evaluation.keep_motions=3",
        "evaluation.rollout.plausible.tilt=0.12",
    )
    outcomes = [row["outcome"] for each in found.values() for row in each.rows]
    assert {"completed", "diverged"} <= set(outcomes)
    for each in found.values():
        kept = [row for row in each.rows if row["t"]]
        completed = [row for row in each.rows if row["outcome"] == "completed"]
        assert len(kept) == 3
        expected = min(3, len(completed))
        assert sum(row["outcome"] == "completed" for row in kept) == expected
        assert sum(dict(row["metrics"])["falls"] for row in each.rows) == each.summary.diverged
