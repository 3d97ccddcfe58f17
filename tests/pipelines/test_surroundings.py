"""What lies around a command: taken names and ports, a home that moved, a data set without good."""

import os
import shutil
import socket

import pytest
from mlflow import MlflowClient

from lmtr.errors import ConfigurationError
from services.home import Home
from services.lake.tables import Lake
from services.tracking import Tracker


def refused(outcome, *words):
    status, _, err = outcome
    assert status == 2, err
    assert "Traceback" not in err
    for word in words:
        assert word in err


def test_what_is_no_regular_file_is_never_replaced(lmtr, tiny_home, tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for command in (["export", "segments"], ["query", "SELECT 1", "--format", "csv"]):
        refused(lmtr(*command, "--out", pipe, "--home", tiny_home), str(pipe), "no regular file")
    assert pipe.is_fifo()


def test_a_link_stays_and_its_file_is_written(lmtr, tiny_home, tmp_path):
    target, link = tmp_path / "target.csv", tmp_path / "link.csv"
    target.write_text("old")
    link.symlink_to(target)
    status, _, err = lmtr("query", "SELECT 1 AS one", "--out", link, "--home", tiny_home)
    assert status == 0, err
    assert link.is_symlink()
    assert target.read_text().split() == ["one", "1"]


def test_a_taken_port_is_named(lmtr, tiny_home):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        refused(lmtr("ui", "--port", port, "--home", tiny_home), str(port), "--port")


def test_a_copied_home_keeps_its_runs_files_below_itself(tiny_home, tmp_path):
    copy = tmp_path / "copy"
    shutil.copytree(tiny_home, copy)
    home = Home.open(copy, create=False)
    tracker = Tracker(f"sqlite:///{home.tracking_db}", home.artifacts)
    client = MlflowClient(tracker.uri)
    for name in ("training", "evaluation"):
        identity = tracker.experiment(name)
        runs = client.search_runs([identity])
        assert runs
        for place in (client.get_experiment(identity).artifact_location,
                      *(run.info.artifact_uri for run in runs)):  # fmt: skip
            assert place.startswith(home.artifacts.as_uri())
    original = MlflowClient(f"sqlite:///{tiny_home}/mlflow.db")
    location = original.get_experiment_by_name("training").artifact_location
    assert location.startswith((tiny_home / "artifacts").as_uri())


def test_a_data_set_without_an_accepted_solution_says_why(lmtr, tiny_config, tmp_path):
    home = tmp_path / "home"
    options = ("-c", tiny_config, "--set", "expert.solver.max_iterations=2", "--home", home)
    assert lmtr("generate", *options, "--solutions", 1)[0] == 0
    refused(lmtr("segment", *options), "none of its 1 solutions", "not_converged:iteration_limit")


def test_a_home_that_cannot_be_written_is_refused_before_any_work(lmtr, tiny_home, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("services.home.tempfile.TemporaryFile", full)
    for command in ("segment", "train", "evaluate", "report"):
        refused(lmtr(command, "--home", tiny_home), "No space left on device", "make room")


@pytest.mark.parametrize("dt", ["nan", "inf", "0"])
def test_a_sample_time_must_be_a_time(lmtr, tiny_home, tmp_path, dt):
    out = tmp_path / "x.parquet"
    refused(lmtr("export", "solutions", "--out", out, "--dt", dt, "--home", tiny_home), "--dt")
    assert not out.exists()


@pytest.mark.parametrize("override", ["range_of_motion_margin=0.2", "limits.height=0.5"])
def test_an_expert_that_does_not_suit_the_robot_leaves_no_trace(lmtr, tmp_path, override):
    home = tmp_path / "home"
    outcome = lmtr("generate", "--set", f"expert.{override}", "--home", home)
    refused(outcome, override.partition("=")[0], "lower it")
    assert not home.exists()


def test_an_expert_that_cannot_be_built_leaves_no_data_set(lmtr, tmp_path, monkeypatch):
    def unbuildable(*_):
        raise ConfigurationError("expert: it must be possible, got none; choose another")

    monkeypatch.setattr("pipelines.expert.Expert", unbuildable)
    home = tmp_path / "home"
    refused(lmtr("generate", "--solutions", 1, "--home", home), "it must be possible")
    assert "datasets" not in Lake(Home.open(home, create=False).lake).tables()


def test_a_cache_that_is_a_file_is_told_with_its_mend(lmtr, tmp_path, monkeypatch):
    cache = tmp_path / "cache"
    cache.write_text("")
    monkeypatch.setenv("LMTR_CACHE", str(cache))

    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("pipelines.generate.produce", stop)  # told before any solve
    _, _, err = lmtr("generate", "--solutions", 1, "--home", tmp_path / "home")
    assert "takes four times as long" in err
    assert (
        f"cache {cache} cannot be used (File exists); name a folder of your own in LMTR_CACHE"
        in err
    )
