"""The training stage: a sweep is resumed, recorded and registered, whatever ends it."""

import dataclasses
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from lmtr.errors import ModelError
from lmtr.policies.distance import TaskWeights
from lmtr.replanners.build import build_replanner
from pipelines import train as stage
from pipelines.config import load
from pipelines.learning_data import learning_data
from pipelines.registry import load as load_model
from pipelines.train import jobs, train
from pipelines.workspace import Workspace

REPOSITORY = Path(__file__).parents[2]


@pytest.fixture
def home(cut_home, tmp_path):
    return shutil.copytree(cut_home, tmp_path / "home")


@pytest.fixture
def opened(home, tiny_config):
    """Configuration, workspace and data of a home that is cut and has no models."""
    config = load(tiny_config, ["training.seeds=[0, 1]"])
    space = Workspace.open(home, config.cluster, create=True)
    dataset_id = space.lake.values("cuts", "dataset_id", "true")[0]
    return config, space, learning_data(config, space, dataset_id)


def client(space):
    from mlflow import MlflowClient

    return MlflowClient(tracking_uri=space.home.tracking_uri)


def runs(space, kind):
    reader = client(space)
    experiment = reader.get_experiment_by_name("training")
    return list(reader.search_runs([experiment.experiment_id], f"tags.kind = '{kind}'"))


def weights(space, model_id):
    return {p.name: p.read_bytes() for p in space.models.folder(model_id).glob("*.safetensors")}


def test_runs_of_models_lie_below_one_run_of_their_sweep(opened):
    config, space, data = opened
    ids = train(config, space, data)
    (sweep,) = runs(space, "sweep")
    assert sweep.info.status == "FINISHED"
    assert sweep.data.tags["dataset_id"] == data.dataset_id
    models = runs(space, "model")
    assert {run.data.tags["model_id"] for run in models} == set(ids)
    for run in models:
        assert run.data.tags["mlflow.parentRunId"] == sweep.info.run_id
        assert {"latent", "kappa", "seed", "mirrored", "segments", "loss_scale"} <= set(
            run.data.params
        )
        assert {
            "best.reconstruction",
            "best.kl",
            "best.active_dimensions",
            "best.base_position_mm",
            "best.times_ms",
            "best.second_foothold_mm",
            "best.forces_weights",
        } <= set(run.data.metrics)


def test_a_sweep_goes_on_where_it_stopped_below_the_same_run(opened, monkeypatch):
    config, space, data = opened
    broken = jobs(config, data)[1].model_id
    real = stage.fit

    def failing(model, *arguments, **options):
        if options["provenance"]["model_id"] == broken:
            raise RuntimeError("bad apple")
        return real(model, *arguments, **options)

    monkeypatch.setattr(stage, "fit", failing)
    with pytest.raises(ModelError, match=f"{broken} .RuntimeError: bad apple.; the other models"):
        train(config, space, data)
    (sweep,) = runs(space, "sweep")
    assert sweep.info.status == "FAILED"
    trained = []

    def counted(model, *arguments, **options):
        trained.append(options["provenance"]["model_id"])
        return real(model, *arguments, **options)

    monkeypatch.setattr(stage, "fit", counted)
    ids = train(config, space, data)
    assert trained == [broken]
    (again,) = runs(space, "sweep")
    assert (again.info.run_id, again.info.status) == (sweep.info.run_id, "FINISHED")
    children = runs(space, "model")
    assert sorted(run.data.tags["model_id"] for run in children) == sorted(ids)
    assert {run.data.tags["mlflow.parentRunId"] for run in children} == {sweep.info.run_id}


def test_a_model_that_was_half_recorded_goes_on_in_its_run(opened, monkeypatch):
    config, space, data = opened
    one = config.training.model_copy(update={"latent": (2,), "seeds": (0,)})
    config = config.model_copy(update={"training": one})
    with monkeypatch.context() as patch:
        patch.setattr(stage, "register", refused)
        with pytest.raises(OSError, match="disk full"):
            train(config, space, data)
    (half,) = runs(space, "model")
    assert half.info.status == "FAILED"
    (model_id,) = train(config, space, data)
    (whole,) = runs(space, "model")
    assert (whole.info.run_id, whole.info.status) == (half.info.run_id, "FINISHED")
    (version,) = client(space).search_model_versions(f"tags.model_id = '{model_id}'")
    assert version.run_id == whole.info.run_id


def refused(*_arguments):
    raise OSError("disk full")


def test_ctrl_c_keeps_finished_models_and_gives_up_the_others(opened, monkeypatch):
    config, space, data = opened
    real, first = stage.record, jobs(config, data)[0].model_id

    def kept_then_interrupted(*arguments):
        real(*arguments)
        os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(stage, "record", kept_then_interrupted)
    with pytest.raises(KeyboardInterrupt):
        train(config, space, data)
    assert space.lake.values("models", "model_id", "true") == [first]
    (sweep,) = runs(space, "sweep")
    assert sweep.info.status == "KILLED"


def test_a_registered_model_plans_like_our_own_replanner(opened):
    import mlflow

    config, space, data = opened
    ids = train(config, space, data)
    mlflow.set_tracking_uri(space.home.tracking_uri)
    reader = client(space)
    x = data.validation.x if len(data.validation.x) else data.training.x
    for model_id in (ids[0], ids[-1]):
        model = load_model(space, model_id)
        name = model.settings.name.lower()
        (version,) = reader.search_model_versions(
            f"name = '{name}' AND tags.model_id = '{model_id}'"
        )
        loaded = mlflow.pyfunc.load_model(f"models:/{name}/{version.version}")
        own = build_replanner(model, data.training, TaskWeights(), robot=model.robot)
        np.testing.assert_allclose(loaded.predict(x), own.plan(x), rtol=1e-4, atol=1e-3)
        assert loaded.metadata.signature.inputs.inputs[0].shape == (-1, 35)
        assert loaded.metadata.signature.outputs.inputs[0].shape == (-1, 264)
        assert version.tags["latent"] == str(model.latent)
        assert version.tags["dataset_id"] == data.dataset_id
        with pytest.raises(mlflow.exceptions.MlflowException, match=r"(?i)shape"):
            loaded.predict(x[:, :-1])


def test_a_model_is_registered_once(opened):
    config, space, data = opened
    training = config.training.model_copy(update={"latent": (2,), "seeds": (0,)})
    config = config.model_copy(update={"training": training})
    (model_id,) = train(config, space, data)
    shutil.rmtree(space.models.folder(model_id))
    assert train(config, space, data) == [model_id]
    assert len(client(space).search_model_versions(f"tags.model_id = '{model_id}'")) == 1


@pytest.mark.slow
def test_workers_do_not_change_models(opened, tmp_path):
    config, space, data = opened
    twin = dataclasses.replace(
        Workspace.open(shutil.copytree(space.home.root, tmp_path / "twin"), None, create=True),
        cluster_settings=config.cluster.model_copy(update={"workers": 2}),
    )
    ids = train(config, space, data)
    assert train(config, twin, data) == ids
    for model_id in ids:
        assert weights(space, model_id) == weights(twin, model_id)


@pytest.mark.slow
def test_a_killed_sweep_is_completed_by_the_same_command(opened, tiny_config, tmp_path):
    config, space, data = opened
    whole = Workspace.open(
        shutil.copytree(space.home.root, tmp_path / "whole"), config.cluster, create=True
    )
    options = ["training.seeds=[0, 1, 2]", "training.optimizer.epochs=300"]
    options += ["training.optimizer.patience=300"]
    command = [sys.executable, "-m", "pipelines", "--home", str(space.home.root), "train"]
    command += ["-c", str(tiny_config), *(part for each in options for part in ("--set", each))]
    command += ["--workers", "2"]
    driver = subprocess.Popen(command, cwd=REPOSITORY, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 120
    while not kept(space) and driver.poll() is None and time.monotonic() < deadline:
        time.sleep(0.05)
    assert driver.poll() is None
    driver.kill()
    driver.wait()
    before = kept(space)
    assert 0 < len(before) < 6
    assert subprocess.run(command, cwd=REPOSITORY, check=False).returncode == 0
    assert len(kept(space)) == 6
    assert len(runs(space, "sweep")) == 1
    ids = train(load(tiny_config, options), whole, data)
    assert set(ids) == set(kept(space))
    for model_id in ids:
        assert weights(space, model_id) == weights(whole, model_id)


def kept(space):
    if not space.lake.exists("models"):
        return []
    return space.lake.values("models", "model_id", "true")
