"""Tracking: what runs record can be read back, and their end is told truly."""

import math
import sqlite3
import time

import pytest
from matplotlib.figure import Figure

from services.errors import TrackingError
from services.home import Home
from services.tracking import Tracker, ui_command, ui_environment


@pytest.fixture(scope="module")
def tracker(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tracking")
    return Tracker(f"sqlite:///{folder}/mlflow.db", folder / "artifacts")


@pytest.fixture
def reader(tracker):
    from mlflow import MlflowClient

    return MlflowClient(tracking_uri=tracker.uri)


def test_runs_that_were_killed_end_when_they_were_last_heard_of(tracker, reader):
    experiment = tracker.experiment("killed")
    ours, theirs = "/data/o'brien", "/data/other"

    def begun(home, began_ms, *heard_ms, **tags):
        made = reader.create_run(experiment, start_time=began_ms, tags={"home": home, **tags})
        for timestamp in heard_ms:
            reader.log_metric(made.info.run_id, "loss", 1.0, timestamp=timestamp)
        return made.info.run_id

    now = int(time.time() * 1000)
    silent = begun(ours, 1_000, data="a")
    heard = begun(ours, 1_000, 2_000, 3_000, data="a")
    alive = begun(ours, 1_000, now, data="a")
    others = [begun(ours, 1_000, data="b"), begun(theirs, 1_000, data="a")]
    with Tracker(tracker.uri, tracker.artifacts, ours).run(experiment, "done", {}, {"data": "a"}):
        pass

    def ended():
        runs = [run.info for run in reader.search_runs([experiment])]
        return {run.run_id: run.end_time for run in runs if run.status == "KILLED"}

    home = Tracker(tracker.uri, tracker.artifacts, ours)
    home.end_lost(experiment, {"data": "a"}, silent_s=600.0)
    assert ended() == {silent: 1_000, heard: 3_000}
    home.end_lost(experiment, {"data": "a"})
    assert ended() == {silent: 1_000, heard: 3_000, alive: now}
    assert {reader.get_run(run).info.status for run in others} == {"RUNNING"}


def test_a_run_can_be_read_back(tracker, reader, tmp_path):
    (tmp_path / "model").mkdir()
    (tmp_path / "model" / "weights.txt").write_text("1 2 3")
    (tmp_path / "picture.png").write_bytes(b"png")
    figure = Figure()
    figure.add_subplot().plot([1, 2])
    params = {"latent": 6, "model": {"kappa": 1e-3, "hidden": [64, 64]}, "odd[key]": None}
    experiment = tracker.experiment("read back")
    with tracker.run(experiment, "lmtr-6", params, {"stage": "train"}) as run:
        run.metrics((f"loss.{k}", 0.5 * k, step) for k in range(2) for step in range(1500))
        run.metrics([("nan", math.nan, 0)])
        run.figure(figure, "learning.png")
        run.figure(tmp_path / "picture.png", "shown/motion.png")
        run.artifacts(tmp_path / "model", "model")
        run.tag("model_id", "m1")
    found = reader.get_run(run.id)
    assert found.info.status == "FINISHED"
    assert found.info.run_name == "lmtr-6"
    assert found.data.params == {
        "latent": "6",
        "model.kappa": "0.001",
        "model.hidden": "[64, 64]",
        "odd_key_": "None",
    }
    assert found.data.tags["stage"] == "train"
    assert found.data.tags["model_id"] == "m1"
    history = reader.get_metric_history(run.id, "loss.1")
    assert sorted((m.step, m.value) for m in history) == [(step, 0.5) for step in range(1500)]
    assert math.isnan(found.data.metrics["nan"])
    kept = tracker.artifacts / run.id / "artifacts"
    assert (kept / "learning.png").read_bytes().startswith(b"\x89PNG")
    assert (kept / "shown" / "motion.png").read_bytes() == b"png"
    assert (kept / "model" / "weights.txt").read_text() == "1 2 3"


def test_a_long_parameter_is_cut_and_kept_whole_as_a_file(tracker, reader):
    text = "ü" * 20_000
    with tracker.run(tracker.experiment("long"), "run", {"a/config": text}, {}) as run:
        pass
    cut = reader.get_run(run.id).data.params["a/config"]
    assert cut == "ü" * 499 + "…"
    kept = tracker.artifacts / run.id / "artifacts" / "params" / "a.config.txt"
    assert kept.read_text(encoding="utf-8") == text


def test_many_parameters_fit(tracker, reader):
    params = {f"p{k}": k for k in range(250)}
    with tracker.run(tracker.experiment("many"), "run", params, {}) as run:
        pass
    assert len(reader.get_run(run.id).data.params) == 250


@pytest.mark.parametrize(
    ("error", "status"), [(ValueError("diverged"), "FAILED"), (KeyboardInterrupt(), "KILLED")]
)
def test_a_run_that_is_broken_off_is_marked(tracker, reader, error, status):
    ids = []

    def break_off():
        with tracker.run(tracker.experiment("broken"), "run", {}, {}) as run:
            ids.append(run.id)
            run.metrics([("loss", 1.0, 0)])
            raise error

    with pytest.raises(type(error)):
        break_off()
    found = reader.get_run(ids[0])
    assert found.info.status == status
    assert found.data.metrics == {"loss": 1.0}


def test_runs_can_belong_to_a_run(tracker, reader):
    experiment = tracker.experiment("nested")
    with (
        tracker.run(experiment, "outer", {}, {}) as outer,
        tracker.run(experiment, "inner", {}, {}, parent=outer.id) as inner,
    ):
        pass
    assert reader.get_run(inner.id).data.tags["mlflow.parentRunId"] == outer.id


def test_a_run_goes_on_where_its_process_was_killed(tracker, reader):
    experiment, identity = tracker.experiment("gone on with"), "model-7"
    asked = (experiment, "seven", {"latent": 6, "odd[key]": 1}, {"stage": "train"}, identity)
    with tracker.run(*asked, parent="first", began=12.5) as run:
        run.metrics([("loss", 1.0, 0)])
    # What a process leaves that is killed before it has recorded all parameters.
    other = (experiment, "seven", {"latent": 7, "kappa": 0.5, "odd[key]": 2}, {"stage": "again"})
    reader.update_run(run.id, status="RUNNING")
    with tracker.run(*other, identity, parent="second") as again:
        assert again.id == run.id
    found = reader.get_run(run.id)
    assert (found.info.status, found.info.start_time) == ("FINISHED", 12_500)
    assert found.data.params == {"latent": "6", "odd_key_": "1", "kappa": "0.5"}
    assert found.data.tags["stage"] == "again"
    assert found.data.tags["mlflow.parentRunId"] == "second"
    with tracker.run(*other, "model-8") as new:
        assert new.id != run.id


def test_an_experiment_keeps_its_id_even_out_of_the_bin(tracker, reader):
    made = tracker.experiment("binned")
    reader.delete_experiment(made)
    assert Tracker(tracker.uri, tracker.artifacts).experiment("binned") == made
    assert reader.get_experiment(made).lifecycle_stage == "active"


def test_what_cannot_be_recorded_is_a_tracking_error(tracker, tmp_path):
    with pytest.raises(TrackingError, match=r"run 'x' cannot be recorded: .*No Experiment"):
        tracker.run("12345", "x", {}, {}).__enter__()
    with (
        tracker.run(tracker.experiment("faults"), "x", {}, {}) as run,
        pytest.raises(TrackingError, match="files cannot be recorded"),
    ):
        run.artifacts(tmp_path / "missing", "model")
    (tmp_path / "bad.db").write_text("no database" * 100)
    with pytest.raises(TrackingError, match="experiment 'a' cannot be recorded") as caught:
        Tracker(f"sqlite:///{tmp_path}/bad.db", tmp_path).experiment("a")
    assert "\n" not in str(caught.value)


CREATOR = """
import sys
from pathlib import Path
from services.tracking import Tracker
tracker = Tracker(sys.argv[1], Path(sys.argv[2]))
print("ready", flush=True)
sys.stdin.readline()
print(tracker.experiment("training"))
"""


def test_processes_that_make_one_experiment_in_a_new_database_agree(tmp_path, spawn):
    creators = [spawn(CREATOR, f"sqlite:///{tmp_path}/mlflow.db", tmp_path) for _ in range(2)]
    assert [creator.stdout.readline() for creator in creators] == ["ready\n"] * 2
    ids = {creator.communicate("go\n", timeout=90)[0] for creator in creators}
    assert len(ids) == 1
    with sqlite3.connect(tmp_path / "mlflow.db") as database:
        rows = database.execute("SELECT experiment_id FROM experiments WHERE name = 'training'")
        assert [f"{row[0]}\n" for row in rows] == list(ids)


def test_importing_the_tracker_does_not_import_mlflow(spawn):
    asking = spawn("import sys, services.tracking; print('mlflow' in sys.modules)")
    assert asking.communicate(timeout=60)[0] == "False\n"


def test_the_page_is_served_to_this_machine_alone(tmp_path):
    command = ui_command(Home.open(tmp_path / "home", create=True), 5123)
    assert command[command.index("--host") + 1] == "127.0.0.1"
    assert command[command.index("--port") + 1] == "5123"
    assert (
        command[command.index("--backend-store-uri") + 1] == f"sqlite:///{tmp_path}/home/mlflow.db"
    )
    assert ui_environment() == {
        "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false",
        "MLFLOW_DISABLE_TELEMETRY": "true",
        "DO_NOT_TRACK": "true",
    }


def test_homes_that_share_a_tracker_have_runs_of_their_own(tracker, reader):
    experiment = tracker.experiment("shared")
    ids = []
    for place in ("/data/a", "/data/b", "/data/a"):
        theirs = Tracker(tracker.uri, tracker.artifacts, place)
        with theirs.run(experiment, "lmtr-6", {}, {}, identity="lmtr-6-s0-abc") as run:
            ids.append(run.id)
    assert ids[0] == ids[2] != ids[1]
    assert [reader.get_run(run_id).data.tags["home"] for run_id in ids[:2]] == [
        "/data/a",
        "/data/b",
    ]
