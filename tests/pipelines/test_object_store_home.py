"""The command line on a home in an object store: filled, asked, looked over, learned from."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request

import numpy as np
import pytest
from s3_servers import BUCKET, dropping_conditions

from lmtr.replanners import artifact
from lmtr.vectors.layout import TASK_LAYOUT
from pipelines.registry import is_trained, load
from pipelines.workspace import Workspace

SHORT = """
[dataset]
name = "short"
solutions = 4

[expert.scope]
duration = 2.5
n_swings = 2

[tasks]
goal_distance = [0.7, 0.9]
goal_lateral = 0.1
first_obstacle = [0.4, 0.5]
obstacle_count = [1, 1]

[segmentation]
epochs_per_solution = 8

[training]
latent = [0]
validation_share = 0.5

[training.optimizer]
epochs = 2
"""


@pytest.fixture
def config(tmp_path):
    path = tmp_path / "short.toml"
    path.write_text(SHORT)
    return path


def done(outcome) -> str:
    status, out, err = outcome
    assert status == 0, err
    return out


@pytest.fixture(params=["moto", pytest.param("radosgw", marks=pytest.mark.slow)])
def place(request, reach, prefix) -> str:
    """Address of a home."""
    reach(request.getfixturevalue(request.param))
    return f"s3://{BUCKET}/{prefix}/home"


def test_a_data_set_and_its_model_live_in_a_store(lmtr, place, config, tmp_path, monkeypatch):
    workers = ("--workers", "0")
    dataset = done(lmtr("--home", place, "generate", "-c", config, *workers)).strip()
    counted = "SELECT count(*) AS n, count(DISTINCT index) AS d FROM solutions"
    # From here on another machine: nothing of this one's companion folder is needed.
    monkeypatch.setenv("LMTR_STATE", str(tmp_path / "second"))
    monkeypatch.setenv("LMTR_HOME", place)
    assert json.loads(done(lmtr("query", counted, "--format", "json"))) == [{"n": 4, "d": 4}]
    assert done(lmtr("generate", "-c", config, *workers)).strip() == dataset
    assert json.loads(done(lmtr("query", counted, "--format", "json"))) == [{"n": 4, "d": 4}]
    done(lmtr("segment", "-c", config))
    done(lmtr("train", "-c", config, *workers))
    asked = lmtr("query", "SELECT model_id FROM models", "--format", "json")
    (row,) = json.loads(done(asked))

    monkeypatch.setenv("LMTR_STATE", str(tmp_path / "third"))
    workspace = Workspace.open(place, create=False)
    assert not workspace.models.folder(row["model_id"]).exists()
    assert is_trained(workspace, row["model_id"])
    assert load(workspace, row["model_id"]).settings.latent == 0
    assert workspace.models.folder(row["model_id"]).is_dir()


@pytest.fixture
def tracking_server(moto, reach, prefix, tmp_path, monkeypatch):
    """MLflow's server, which keeps the files of runs in the store; all homes use it."""
    reach(moto)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = str(probe.getsockname()[1])
    command = [sys.executable, "-m", "mlflow", "server", "--host", "127.0.0.1", "--port", port]
    command += ["--backend-store-uri", f"sqlite:///{tmp_path}/shared.db", "--workers", "1"]
    command += ["--artifacts-destination", f"s3://{BUCKET}/{prefix}/runs"]
    place = {"MLFLOW_S3_ENDPOINT_URL": moto.endpoint, "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false"}
    log = (tmp_path / "server.log").open("w")
    server = subprocess.Popen(
        command, env={**os.environ, **place}, stdout=log, stderr=log, start_new_session=True
    )
    try:
        uri, deadline = f"http://127.0.0.1:{port}", time.monotonic() + 90
        while not healthy(uri):
            assert server.poll() is None, (tmp_path / "server.log").read_text()
            assert time.monotonic() < deadline
            time.sleep(0.2)
        monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
        yield uri
    finally:
        os.killpg(server.pid, signal.SIGTERM)
        server.wait(timeout=30)


def healthy(uri: str) -> bool:
    try:
        return urllib.request.urlopen(f"{uri}/health", timeout=5).status == 200
    except OSError:
        return False


@pytest.mark.slow
def test_a_registered_model_comes_from_a_shared_tracker(
    lmtr, moto, tracking_server, prefix, config, tmp_path, monkeypatch
):
    """Trained on one machine, planned with on another, which has neither home nor lake."""
    import mlflow

    place, workers = f"s3://{BUCKET}/{prefix}/home", ("--workers", "0")
    for stage in (["generate", *workers], ["segment"], ["train", "--latent", "0,2", *workers]):
        done(lmtr("--home", place, *stage, "-c", config))
    asked = "SELECT model_id, latent FROM models"
    rows = json.loads(done(lmtr("--home", place, "query", asked, "--format", "json")))
    x = np.random.default_rng(0).normal(size=(5, TASK_LAYOUT.size))
    mlflow.set_tracking_uri(tracking_server)
    for row in rows:
        out = tmp_path / row["model_id"]
        done(lmtr("--home", place, "export", "replanner", row["model_id"], "--out", out))
        name = f"lmtr-{row['latent']}" if row["latent"] else "unimodal"
        planner = mlflow.pyfunc.load_model(f"models:/{name}/1")
        np.testing.assert_allclose(planner.predict(x), artifact.load(out).plan(x), rtol=1e-6)
    assert any("/runs/" in key and "replanner" in key for key in moto.objects(prefix))


def test_doctor_looks_over_a_home_in_a_store(lmtr, place, monkeypatch):
    monkeypatch.setenv("COLUMNS", "400")
    status, out, _ = lmtr("--home", place, "doctor")
    assert status == 1
    assert "there is no LMTR home" in out
    workspace = Workspace.open(place, create=True)
    out = done(lmtr("--home", place, "doctor"))
    assert place in out
    assert str(workspace.home.root) in out
    assert "answers in" in out
    assert "honoured" in out


def test_doctor_finds_a_careless_gateway(lmtr, moto, reach, prefix, monkeypatch):
    monkeypatch.setenv("COLUMNS", "400")
    reach(moto)
    place = f"s3://{BUCKET}/{prefix}"
    Workspace.open(place, create=True)
    with dropping_conditions(moto) as loose:
        reach(loose)
        status, out, _ = lmtr("--home", place, "doctor")
    assert status == 1
    assert "two writers would overwrite one another's commits" in out


def test_a_store_that_does_not_serve_is_one_line_and_status_two(lmtr, moto, reach, config):
    reach(moto)
    for command in (["generate", "-c", config, "--workers", "0"], ["query", "SELECT 1"]):
        status, out, err = lmtr(*command, "--home", "s3://no-such-bucket/home")
        assert (status, out) == (2, "")
        assert err.count("\n") == 1
        assert "the bucket does not exist; make it" in err


@pytest.mark.slow
def test_workers_of_a_cluster_fill_a_real_store(lmtr, radosgw, reach, prefix, config):
    """Eight tasks on two Ray workers, read back with another client."""
    reach(radosgw)
    place = f"s3://{BUCKET}/{prefix}/home"
    done(
        lmtr(
            *("--home", place, "generate", "-c", config, "--workers", "2"),
            *("--solutions", "8", "--set", "cluster.commit_items=2"),
        )
    )
    asked = 'SELECT "index" AS i FROM solutions ORDER BY ALL'
    rows = json.loads(done(lmtr("--home", place, "query", asked, "--format", "json")))
    assert [row["i"] for row in rows] == list(range(8))
    keys = radosgw.objects(prefix)
    assert f"{prefix}/home/home.json" in keys
    assert sum(key.endswith(".parquet") for key in keys) >= 2
