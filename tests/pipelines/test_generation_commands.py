"""What people type at `lmtr generate` again and again: extend, go on, change, solve once more."""

import json
import re

import pyarrow as pa
import pytest

from pipelines import generate as stage
from pipelines.config import load
from services.home import Home
from services.lake.appender import Appender, Group
from services.lake.digest import row_digests
from services.lake.tables import Lake

SHORT = """
[dataset]
name = "short"
solutions = 3

[expert.scope]
duration = 2.5
n_swings = 2

[tasks]
goal_distance = [0.7, 0.9]
goal_lateral = 0.1
first_obstacle = [0.4, 0.5]
obstacle_count = [1, 1]

[cluster]
workers = 0
commit_items = 2
"""


@pytest.fixture(scope="module")
def config(tmp_path_factory):
    path = tmp_path_factory.mktemp("configuration") / "short.toml"
    path.write_text(SHORT)
    return path


@pytest.fixture
def home(tmp_path):
    return tmp_path / "home"


def solutions(home):
    return Lake(Home.open(home, create=False).lake).read("solutions", order_by="index")


def test_extending_solves_the_rest_only_and_history_tells_the_figures(lmtr, home, config):
    _, made, _ = lmtr("generate", "-c", config, "--home", home)
    before = solutions(home)
    _, same, err = lmtr("generate", "-d", made.strip(), "-n", 5, "-w", 0, "--home", home)
    assert made == same
    rows = solutions(home)
    assert rows["index"].to_pylist() == [0, 1, 2, 3, 4]
    assert rows.slice(0, 3).equals(before)
    assert rows["digest"].to_pylist() == row_digests("solutions", rows)
    lake = Lake(Home.open(home, create=False).lake)
    said = [entry for entry in lake.history("solutions") if "lmtr.solved" in entry]
    assert [entry["lmtr.solved"] for entry in said] == ["2", "3", "2"]
    assert json.loads(said[0]["lmtr.statuses"]) == {"converged": 2}
    _, _, err = lmtr("generate", "-c", config, "--home", home)
    assert "has 5 solutions already, nothing to do" in err


def test_the_trackers_run_holds_the_same_figures(lmtr, home, config):
    _, made, _ = lmtr("generate", "-c", config, "--home", home)
    from mlflow import MlflowClient

    client = MlflowClient(f"sqlite:///{home / 'mlflow.db'}")
    experiment = client.get_experiment_by_name("generation")
    (run,) = client.search_runs([experiment.experiment_id])
    assert run.data.tags["dataset_id"] == made.strip()
    assert run.data.metrics["solved"] == run.data.metrics["committed"] == 3
    assert run.data.metrics["status.converged"] == 3
    assert run.data.params["dataset.name"] == "short"


def test_a_run_whose_call_was_killed_does_not_go_on_for_ever(lmtr, home, config):
    _, made, _ = lmtr("generate", "-c", config, "--home", home)
    from mlflow import MlflowClient

    client = MlflowClient(f"sqlite:///{home / 'mlflow.db'}")
    experiment = client.get_experiment_by_name("generation").experiment_id
    (killed,) = client.search_runs([experiment])
    client.update_run(killed.info.run_id, status="RUNNING")  # a killed process leaves it so
    other = client.create_run(experiment, tags={"dataset_id": "of-another"})
    lmtr("generate", "-d", made.strip(), "-n", 4, "-w", 0, "--home", home)
    ended = {run.info.run_id: run.info.status for run in client.search_runs([experiment])}
    assert ended.pop(killed.info.run_id) == "KILLED"
    assert ended.pop(other.info.run_id) == "RUNNING"
    assert list(ended.values()) == ["FINISHED"]


def test_other_settings_for_a_data_set_are_refused_with_their_differences(lmtr, home, config):
    _, made, _ = lmtr("generate", "-c", config, "--home", home)
    name = made.strip()
    change = ("--set", "tasks.goal_lateral=0.05", "-w", 0)
    status, _, err = lmtr("generate", "-c", config, *change, "-d", name, "--home", home)
    assert status == 2
    assert re.search(r"made with other settings: tasks\.goal_lateral: 0\.1 → 0\.05; use", err)
    assert solutions(home).num_rows == 3
    status, other, err = lmtr("generate", "-c", config, *change, "--home", home)
    assert status == 0
    assert other != made
    assert f"differs from {name} in tasks.goal_lateral: 0.1 → 0.05" in err
    status, _, err = lmtr("generate", "-d", "short-s0-00000000", "--home", home)
    assert status == 2
    assert "is not in this home" in err


def test_what_failed_for_the_machine_is_solved_once_more_on_request(
    lmtr, home, config, monkeypatch
):
    solve = stage.SolveWorker.__call__

    def unlucky(self, index):
        if index == 1:
            raise MemoryError("none left")
        return solve(self, index)

    with monkeypatch.context() as patch:
        patch.setattr(stage.SolveWorker, "__call__", unlucky)
        lmtr("generate", "-c", config, "--home", home)
    assert solutions(home)["status"].to_pylist() == ["converged", "error", "converged"]
    _, _, err = lmtr("generate", "-c", config, "--home", home)
    assert "nothing to do" in err
    _, _, err = lmtr("generate", "-c", config, "--again", "error", "--home", home)
    assert "1 solutions that ended with 'error' are solved once more" in err
    rows = solutions(home)
    assert rows["index"].to_pylist() == [0, 1, 2]
    assert rows["status"].to_pylist() == ["converged"] * 3


def test_an_extended_data_set_gets_back_what_it_lacks(lmtr, home, config, monkeypatch):
    _, made, _ = lmtr("generate", "-c", config, "--home", home)
    go_on = ("generate", "-d", made.strip(), "-w", 0, "--home", home)

    def unlucky(self, index):
        raise MemoryError("none left")

    with monkeypatch.context() as patch:
        patch.setattr(stage.SolveWorker, "__call__", unlucky)
        lmtr(*go_on, "-n", 5)
    lake = Lake(Home.open(home, create=False).lake)
    lake.delete("solutions", "index = 1")
    lmtr(*go_on, "-n", 2)
    assert solutions(home)["index"].to_pylist() == [0, 1, 2, 3, 4]
    lake.delete("solutions", "index = 1")
    status, _, err = lmtr(*go_on, "--again", "error")
    assert status == 0
    assert "2 solutions that ended with 'error' are solved once more" in err
    rows = solutions(home)
    assert rows["index"].to_pylist() == [0, 1, 2, 3, 4]
    assert rows["status"].to_pylist() == ["converged"] * 5


def test_rows_that_somebody_else_commits_meanwhile_are_not_solved_again(home, config, monkeypatch):
    settings = load(str(config), ["cluster.commit_items=1"])
    other = home.with_name("other")
    stage.generate(settings, stage.Workspace.open(other, settings.cluster, create=True))
    theirs = solutions(other)
    solved = []
    solve = stage.SolveWorker.__call__

    def watched(self, index):
        if (
            not solved
        ):  # another driver is quicker with the last one, while this one is at the first
            group = Group("solutions", {"dataset_id": settings.dataset_id}, "index")
            last = theirs.filter(pa.compute.equal(theirs["index"], 2))
            Appender(Lake(home / "lake"), group).append(last)
        solved.append(index)
        return solve(self, index)

    monkeypatch.setattr(stage.SolveWorker, "__call__", watched)
    space = stage.Workspace.open(home, settings.cluster, create=True)
    stage.generate(settings, space)
    rows = solutions(home)
    assert solved == [0, 1]
    assert rows["index"].to_pylist() == [0, 1, 2]
    assert rows["digest"].to_pylist() == theirs["digest"].to_pylist()
