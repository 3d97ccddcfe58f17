"""One command makes everything; a second one makes nothing twice."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from lmtr.models import checkpoint
from lmtr.trajectory.motion import sampled
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT
from lmtr.vectors.segment_vector import decode_segment, encode_segment
from pipelines import records
from pipelines.config import load
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
    assert lmtr("run", tiny_config, "--home", tiny_home)[0] == 0
    status, _, err = lmtr("run", tiny_config, "--home", tiny_home)
    assert status == 0, err
    assert "is up to date" in err
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


def test_the_report_keeps_the_configuration_that_makes_it_again(lake, lmtr, tiny_home, tiny_config):
    (page,) = (tiny_home / "reports").glob("*/index.html")
    kept = page.parent / "configuration.toml"
    assert load(str(kept)) == load(str(tiny_config))
    assert "configuration.toml" in page.read_text()
    before = {name: lake.version(name) for name in lake.tables()}
    assert lmtr("run", kept, "--home", tiny_home)[0] == 0
    assert {name: lake.version(name) for name in lake.tables()} == before
    recorded = json.loads((page.parent / "provenance.json").read_text())
    assert recorded["dataset"]["dataset"]["seed"] == 5
    assert recorded["cut"]["segmentation"]["epochs_per_solution"] == 8
    assert set(recorded["models"]) == {"unimodal", "LMTR-2"}


def test_stages_without_a_configuration_work_on_what_is_there(lake, lmtr, tiny_home):
    before = lake.version("evaluations")
    assert lmtr("report", "--home", tiny_home)[0] == 0
    status, _, err = lmtr("segment", "--home", tiny_home, "--dataset", "none")
    assert status == 2, err
    assert lake.version("evaluations") == before


def test_doctor_finds_a_good_home_good_and_a_broken_tracker_bad(lmtr, tiny_home, tmp_path):
    status, out, _ = lmtr("doctor", "--home", tiny_home)
    assert status == 0, out
    for word in ("casadi", "compiled experts", "table solutions", "MLflow"):
        assert word in out
    assert re.search(r"[1-9]\d* \(\d+\.\d MB\) in", out)
    broken = tmp_path / "broken"
    shutil.copytree(tiny_home, broken)
    (broken / "mlflow.db").write_bytes(b"garbage" * 1000)
    status, out, _ = lmtr("doctor", "--home", broken)
    assert status == 1
    assert "✗" in out


def test_doctor_says_how_to_mend_a_cache_that_others_can_write_to(lmtr, tmp_path, monkeypatch):
    cache = tmp_path / "cache"
    cache.mkdir()
    cache.chmod(0o777)
    monkeypatch.setenv("LMTR_CACHE", str(cache))
    monkeypatch.setenv("COLUMNS", "1000")
    status, out, _ = lmtr("doctor", "--home", tmp_path / "home")
    assert status == 0, out
    assert f"none yet in {cache}" in out
    assert f"chmod go-w {cache}" in out
    status, out, _ = lmtr("doctor", "--home", tmp_path / "home", "--set", "cluster.cache=/dev/null")
    assert "/dev/null cannot be used (File exists); name a folder of your own in LMTR_CACHE" in out


def test_runs_are_logged_with_curves_metrics_and_data_version(lake, tiny_home):
    from mlflow import MlflowClient

    client = MlflowClient(f"sqlite:///{tiny_home}/mlflow.db")
    row = lake.read("models", where="latent = 2").to_pylist()[0]
    run = client.get_run(row["mlflow_run_id"])
    assert run.info.status == "FINISHED"
    assert run.data.params["latent"] == "2"
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


SAMPLED = {
    "t": pa.float64(),
    "base_pos_W": pa.list_(pa.float64()),
    "base_rpy": pa.list_(pa.float64()),
    "base_linvel_W": pa.list_(pa.float64()),
    "base_angvel_W": pa.list_(pa.float64()),
    "foot_pos_W": pa.list_(pa.float64()),
    "foot_force_W": pa.list_(pa.float64()),
    "foot_contact": pa.list_(pa.bool_()),
}


def columns_of(table):
    return {
        field.name: pa.list_(field.type.value_type) if pa.types.is_list(field.type) else field.type
        for field in table.schema
    }


def test_exported_rollouts_keep_the_contract(lake, lmtr, tiny_home, tmp_path):
    out = tmp_path / "rollouts.parquet"
    status, _, err = lmtr("export", "rollouts", "--out", out, "--home", tiny_home)
    assert status == 0, err
    samples = pq.read_table(out)
    footholds = pq.read_table(tmp_path / "rollouts.footholds.parquet")
    obstacles = pq.read_table(tmp_path / "rollouts.obstacles.parquet")
    text, real = pa.string(), pa.float64()
    assert columns_of(samples) == {"rollout_id": text, "replanner": text} | SAMPLED
    assert columns_of(obstacles) == {"rollout_id": text, "x": real, "y": real, "alpha": real}
    assert columns_of(footholds) == {"rollout_id": text, "foot": text} | dict.fromkeys(
        ("x", "y", "t_touchdown", "t_liftoff"), real
    )
    holds = footholds.to_pandas()
    assert set(holds["foot"]) == {"LF", "RF", "LH", "RH"}
    assert (holds["t_liftoff"] >= holds["t_touchdown"]).all()
    row = lake.read("rollouts", order_by="rollout_id", limit=1).to_pylist()[0]
    mine = samples.to_pandas().query("rollout_id == @row['rollout_id']")
    assert_samples_equal(mine, records.motion_of(row))


def test_exported_solutions_keep_the_contract(lake, lmtr, tiny_home, tmp_path):
    out = tmp_path / "solutions.parquet"
    options = ("--dt", 0.02, "--where", "accepted", "--limit", 2, "--home", tiny_home)
    status, _, err = lmtr("export", "solutions", "--out", out, *options)
    assert status == 0, err
    table = pq.read_table(out)
    assert columns_of(table) == {"dataset_id": pa.string(), "solution_index": pa.int64()} | SAMPLED
    frame = table.to_pandas()
    indices = frame["solution_index"].unique()
    assert len(indices) == 2
    for index in indices:
        row = lake.read("solutions", where=f"index = {index}").to_pylist()[0]
        motion = sampled(records.trajectory_of(row), 0.02)
        assert_samples_equal(frame[frame["solution_index"] == index], motion)
        assert_feet_stand_and_push_only_in_stance(motion)


def assert_samples_equal(frame, motion):
    np.testing.assert_array_equal(frame["t"], motion.times)
    for column, expected in {
        "base_pos_W": motion.base_position_W,
        "base_rpy": motion.base_rpy,
        "base_linvel_W": motion.base_velocity_W,
        "base_angvel_W": motion.base_angular_velocity_W,
        "foot_pos_W": motion.foot_position_W,
        "foot_force_W": motion.foot_force_W,
        "foot_contact": motion.contact,
    }.items():
        found = np.stack(frame[column])
        np.testing.assert_array_equal(found, expected.reshape(len(found), -1), err_msg=column)


def assert_feet_stand_and_push_only_in_stance(motion):
    assert np.abs(motion.foot_force_W[~motion.contact]).max() == 0.0
    holds = motion.footholds
    for foot, place, begin, end in zip(
        holds.foot, holds.position_W, holds.touchdown, holds.liftoff, strict=True
    ):
        inside = (motion.times >= begin) & (motion.times < end)
        assert motion.contact[inside, foot].all()
        np.testing.assert_allclose(
            motion.foot_position_W[inside, foot], [[*place, 0.0]] * inside.sum(), atol=1e-9
        )


def test_a_table_shows_lists_maps_and_brackets_as_they_are(lmtr, tiny_home):
    sql = (
        "SELECT [1, 2] AS list, MAP {'height': 0.25} AS map, '[bold]text' AS text, "
        "range(100) AS long"
    )
    status, out, err = lmtr("query", sql, "--home", tiny_home)
    assert status == 0, err
    for shown in ("[1, 2]", "[height: 0.25]", "[bold]text", "100 values"):
        assert shown in " ".join(out.replace("│", " ").split())


def test_pictures_of_a_solution_and_of_a_rollout(lmtr, lake, tiny_home, tmp_path):
    rollout = lake.query_value("SELECT min(rollout_id) FROM rollouts")
    for what, name in (("solution", "0"), ("rollout", rollout)):
        status, out, err = lmtr(
            "show", what, name, "--no-animation", "--out", tmp_path, "--home", tiny_home
        )
        assert status == 0, err
        assert Path(out.strip()).read_bytes()[:4] == b"\x89PNG"
