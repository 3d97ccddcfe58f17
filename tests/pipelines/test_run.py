"""One command makes everything; a second one makes nothing twice."""

import json
import re
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from lmtr.models import checkpoint
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT
from lmtr.vectors.segment_vector import decode_segment, encode_segment
from services.home import Home
from services.lake.tables import Lake


@pytest.fixture(scope="module")
def lake(tiny_home):
    return Lake(Home.open(tiny_home, create=False).lake)


def test_every_table_has_its_rows(lake):
    counts = {name: lake.query_value(f"SELECT count(*) FROM {name}") for name in lake.tables()}
    assert counts["datasets"] == 1
    assert counts["solutions"] == 6
    assert counts["models"] == 2
    assert counts["evaluations"] == 3
    assert counts["rollouts"] == 6
    accepted = lake.query_value("SELECT count(*) FROM solutions WHERE accepted")
    assert 0 < counts["segments"] <= accepted * 16


def test_a_second_run_changes_no_table(lake, lmtr, tiny_home, tiny_config):
    before = {name: lake.version(name) for name in lake.tables()}
    status, _, err = lmtr("run", tiny_config, "--home", tiny_home)
    assert status == 0, err
    assert {name: lake.version(name) for name in lake.tables()} == before


def test_more_solutions_extend_the_data_set_and_keep_its_rows(
    lake, lmtr, tiny_config, tiny_home, tmp_path
):
    home = tmp_path / "grown"
    for count in (1, 3):
        status, out, err = lmtr("generate", "-c", tiny_config, "--solutions", count, "--home", home)
        assert status == 0, err
    dataset_id = out.strip().splitlines()[-1]
    grown = Lake(Home.open(home, create=False).lake)
    columns = ["index", "cost", "base_nodes", "force_nodes", "reject_reasons"]
    rows = grown.read("solutions", columns, order_by="index").to_pylist()
    same = lake.read(
        "solutions", columns, where=f"dataset_id = '{dataset_id}' AND index < 3", order_by="index"
    ).to_pylist()
    assert rows == same


def test_segments_are_split_by_solution(lake):
    mixed = lake.query_value(
        "SELECT count(*) FROM (SELECT solution_index FROM segments GROUP BY ALL "
        "HAVING count(DISTINCT split) > 1)"
    )
    assert mixed == 0
    assert lake.query_value("SELECT count(DISTINCT split) FROM segments") == 2


def test_models_carry_their_data_version_and_plan(lake, tiny_home):
    row = lake.read("models", where="latent = 2").to_pylist()[0]
    model = checkpoint.load(tiny_home / "models" / row["folder"])
    assert model.provenance["dataset_id"] == row["dataset_id"]
    assert model.provenance["segments_version"] == row["segments_version"]
    x = np.array(lake.read("segments", ["x"], limit=3)["x"].to_pylist())
    assert model.predict(x, np.zeros((3, 2))).shape == (3, 264)


def test_the_report_shows_only_pictures_that_are_there(tiny_home):
    (page,) = (tiny_home / "reports").glob("*/index.html")
    text = page.read_text()
    pictures = re.findall(r'<img src="([^"]+)"', text)
    assert len(pictures) >= 10
    assert all((page.parent / picture).stat().st_size > 1000 for picture in pictures)
    for word in ("unimodal", "LMTR-2", "trajectory library", "expert", "accepted"):
        assert word in text


def test_runs_are_logged_with_curves_metrics_and_data_version(lake, tiny_home):
    from mlflow import MlflowClient

    client = MlflowClient(f"sqlite:///{tiny_home}/mlflow.db")
    row = lake.read("models", where="latent = 2").to_pylist()[0]
    run = client.get_run(row["mlflow_run_id"])
    assert run.info.status == "FINISHED"
    assert run.data.params["model.latent"] == "2"
    assert run.data.params["dataset_id"] == row["dataset_id"]
    assert int(run.data.params["segments_version"]) == row["segments_version"]
    curve = client.get_metric_history(run.info.run_id, "train.loss")
    assert [point.step for point in curve] == [1, 2, 3, 4]
    assert any(f.path == "learning.png" for f in client.list_artifacts(run.info.run_id))
    for evaluation in lake.read("evaluations").to_pylist():
        logged = client.get_run(evaluation["mlflow_run_id"]).data
        assert "close_share" in logged.metrics
        assert logged.params["replanner"] == evaluation["replanner"]


def test_exported_segments_decode_and_carry_their_layouts(lmtr, tiny_home, tmp_path):
    out = tmp_path / "segments.parquet"
    status, _, err = lmtr("export", "segments", "--out", out, "--home", tiny_home)
    assert status == 0, err
    table = pq.read_table(out)
    metadata = table.schema.metadata
    assert json.loads(metadata[b"lmtr.task_layout"]) == TASK_LAYOUT.metadata()
    assert json.loads(metadata[b"lmtr.segment_layout"]) == SEGMENT_LAYOUT.metadata()
    tau = np.array(table["tau"].to_pylist())
    assert tau.shape == (table.num_rows, 264)
    np.testing.assert_allclose(encode_segment(decode_segment(tau)), tau, rtol=1e-6, atol=1e-6)


def test_exported_rollouts_keep_the_contract(lmtr, tiny_home, tmp_path):
    out = tmp_path / "rollouts.parquet"
    status, _, err = lmtr("export", "rollouts", "--out", out, "--home", tiny_home)
    assert status == 0, err
    samples = pq.read_table(out)
    footholds = pq.read_table(tmp_path / "rollouts.footholds.parquet").to_pandas()
    obstacles = pq.read_table(tmp_path / "rollouts.obstacles.parquet")
    assert obstacles.column_names == ["rollout_id", "x", "y", "alpha"]
    assert set(footholds["foot"]) == {"LF", "RF", "LH", "RH"}
    assert (footholds["t_liftoff"] >= footholds["t_touchdown"]).all()
    _assert_standing_feet_stand_and_swinging_feet_push_not(samples.to_pandas(), "rollout_id")


def test_exported_solutions_keep_the_contract(lmtr, tiny_home, tmp_path):
    out = tmp_path / "solutions.parquet"
    options = ("--dt", 0.02, "--where", "accepted", "--limit", 2, "--home", tiny_home)
    status, _, err = lmtr("export", "solutions", "--out", out, *options)
    assert status == 0, err
    frame = pq.read_table(out).to_pandas()
    assert frame["solution_index"].nunique() == 2
    assert np.allclose(np.diff(frame["t"])[: int(7.5 / 0.02) - 1], 0.02)
    _assert_standing_feet_stand_and_swinging_feet_push_not(frame, "solution_index")


def _assert_standing_feet_stand_and_swinging_feet_push_not(frame, key):
    for _, motion in frame.groupby(key):
        contact = np.stack(motion["foot_contact"])
        position = np.stack(motion["foot_pos_W"]).reshape(len(motion), 4, 3)
        force = np.stack(motion["foot_force_W"]).reshape(len(motion), 4, 3)
        assert np.abs(force[~contact]).max() == 0.0
        both = contact[1:] & contact[:-1]
        moved = np.linalg.norm(np.diff(position, axis=0), axis=-1)
        # A foot that touched down and lifted off between two samples stands elsewhere.
        assert np.median(moved[both]) == 0.0
        assert np.abs(position[..., 2][contact]).max() < 1e-6


def test_pictures_of_a_solution_and_of_a_rollout(lmtr, lake, tiny_home, tmp_path):
    rollout = lake.query_value("SELECT min(rollout_id) FROM rollouts")
    for what, name in (("solution", "0"), ("rollout", rollout)):
        status, out, err = lmtr(
            "show", what, name, "--no-animation", "--out", tmp_path, "--home", tiny_home
        )
        assert status == 0, err
        assert Path(out.strip()).read_bytes()[:4] == b"\x89PNG"
