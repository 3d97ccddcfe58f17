"""Training on the expert's own segments: it learns, and its latent space is in use (Sec. 5.3)."""

import pytest

from lmtr.models import checkpoint
from pipelines.config import load
from pipelines.generate import generate
from pipelines.learning_data import learning_data
from pipelines.segment import segment
from pipelines.train import train
from pipelines.workspace import Workspace

SMALL = [
    "dataset.solutions=24",
    "dataset.seed=5",
    "training.latent=[0, 4]",
    "training.optimizer.epochs=40",
    "training.optimizer.device=cpu",
    "cluster.workers=0",
]


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """The unimodal regressor and LMTR-4, from expert to weights."""
    config = load(None, SMALL)
    home = tmp_path_factory.mktemp("homes") / "small"
    workspace = Workspace.open(home, config.cluster, create=True)
    dataset_id = generate(config, workspace)
    segment(config, workspace, dataset_id)
    model_ids = train(config, workspace, learning_data(config, workspace, dataset_id))
    unimodal, multimodal = (checkpoint.load(home / "models" / name) for name in model_ids)
    assert (unimodal.latent, multimodal.latent) == (0, 4)
    return unimodal, multimodal


def looks(model):
    return [record.validation for record in model.history if record.validation is not None]


@pytest.mark.slow
def test_curves_of_training_and_validation_go_down(trained):
    for model in trained:
        first, last = looks(model)[0], looks(model)[-1]
        assert last.loss < 0.7 * first.loss
        assert last.errors.second_foothold_mm < 0.9 * first.errors.second_foothold_mm
        assert model.history[-1].loss < 0.6 * model.history[0].loss


@pytest.mark.slow
def test_the_latent_space_carries_what_the_task_leaves_open(trained):
    unimodal, multimodal = (model.best_epoch.validation for model in trained)
    assert multimodal.kl > 1.0
    assert multimodal.active_dimensions >= 2
    assert unimodal.kl == 0.0
    # Of solutions that neither has seen, the mode says what no task can.
    assert multimodal.reconstruction < unimodal.reconstruction
    # The gain is worth its price in Eq. 5.
    assert multimodal.loss < unimodal.loss
