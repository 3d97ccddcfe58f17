"""`lmtr doctor --cluster` against a real Ray head with a real MLflow server, well and not well."""

import json
import os

import pytest
from ray_head import RayHead
from tracking_server import mlflow_server

from pipelines.checkup import cluster as module

pytestmark = [pytest.mark.slow, pytest.mark.cluster]

STUCK = """
import time
if "default_worker.py" in open("/proc/self/cmdline").read():
    time.sleep(600.0)
"""
"""Python of a machine on which no work begins, as on a network disk that hangs."""

MISSING = "RAY_health_check_period_ms"


def findings(user, *words):
    done = user.types("doctor", "--cluster", *words, "--json")
    assert done.stdout, done.stderr
    told = json.loads(done.stdout)
    assert told["healthy"] == (done.returncode == 0), done.stderr
    return {each["what"]: each for each in told["findings"]}


def grades(found) -> set[str]:
    return {each["grade"] for each in found.values()}


def test_a_cluster_that_is_well(head, user, cluster_home):
    for home in (False, True):
        found = findings(user)
        assert grades(found) == {"good"}, found
        assert found["home"]["state"].endswith(": the first job makes it") is not home
        assert cluster_home.exists() is home
        if not home:
            done = user.types("submit", "generate", "-c", "walks.toml", "-n", 1, "--follow")
            assert done.returncode == 0, done.stderr
    assert "refused" in found["strangers"]["state"]
    assert str(head.token_file) in found["token"]["state"]
    assert "2 offered in all" in found["processors"]["state"]
    assert "as this client's" in found["clocks"]["state"]
    shown = user.types("doctor", "--cluster")
    assert shown.returncode == 0
    assert "✗" not in shown.stdout
    assert head.token_file.read_text() not in shown.stdout + shown.stderr
    assert "doctor-" not in user.types("jobs").stdout


def test_no_token_a_wrong_one_and_one_that_all_can_read(head, user, tmp_path):
    none = type(user)(tmp_path, {**user.environment, "LMTR_SETTINGS": str(tmp_path / "none.toml")})
    found = findings(none, head.url)
    assert found["token"]["grade"] == "fault"
    assert "wants a token, and none is named" in found["token"]["state"]
    assert "RAY_AUTH_TOKEN_PATH" in found["token"]["mend"]
    wrong = tmp_path / "wrong"
    wrong.write_text("0" * 64)
    wrong.chmod(0o644)
    environment = {**none.environment, "RAY_AUTH_TOKEN_PATH": str(wrong)}
    found = findings(type(user)(tmp_path, environment), head.url)
    assert found["token"]["grade"] == "fault"
    assert f"refuses the token from {wrong}" in found["token"]["state"]
    assert "copy the present one" in found["token"]["mend"]
    assert found["token file"]["mend"] == f"chmod 600 {wrong}"
    assert "versions of jobs" not in found


def test_a_second_node_that_lacks_a_variable_is_named(head, user):
    with head.worker(cpus=1, environment={MISSING: None}):
        lines = json.loads(user.types("doctor", "--cluster", "--json").stdout)["findings"]
    (lacking,) = [line for line in lines if line["grade"] != "good"]
    assert (lacking["what"], lacking["grade"]) == ("RAY_… variables", "warning")
    assert MISSING in lacking["state"]
    assert "(head)" not in lacking["state"]
    states = [line["state"] for line in lines]
    assert "all 2 nodes: answer" in states
    assert "all 2 nodes: 3 offered in all" in states


def test_a_second_node_that_does_not_answer_is_named(head, user, tmp_path):
    (folder := tmp_path / "stuck").mkdir()
    (folder / "sitecustomize.py").write_text(STUCK)
    path = os.pathsep.join([str(folder), os.environ["PYTHONPATH"]])
    with head.worker(cpus=1, environment={"PYTHONPATH": path}):
        done = user.types("doctor", "--cluster", "--json")
    assert done.returncode == 1
    lines = json.loads(done.stdout)["findings"]
    (silent,) = [line for line in lines if line["grade"] != "good"]
    assert (silent["what"], silent["grade"]) == ("nodes", "fault")
    assert "does not say what it has: no answer within" in silent["state"]
    assert "(head)" not in silent["state"]
    assert "lmtr status" in silent["mend"]


def test_runs_go_to_the_server_that_the_machines_name_and_an_open_cluster_is_told(
    head, user, tmp_path, monkeypatch
):
    (folder := tmp_path / "mlflow").mkdir()
    with mlflow_server(folder) as uri:
        text = head.settings.read_text()
        settings = tmp_path / "settings.toml"
        settings.write_text(f'{text}tracking = "{uri}"\n')
        mine = type(user)(tmp_path, {**user.environment, "LMTR_SETTINGS": str(settings)})
        found = findings(mine)
        assert found["MLflow from here"]["grade"] == "good"
        inside = found["MLflow from the head"]
        assert inside["grade"] == "warning"
        assert f"set LMTR_TRACKING on every node, or no run reaches {uri}" in inside["mend"]
        monkeypatch.setenv("LMTR_TRACKING", uri)
        (other := tmp_path / "other").mkdir()
        with RayHead(other, other / "home", cpus=1, closed=False) as second:
            found = findings(type(user)(tmp_path, second.client))
            assert (found["strangers"]["grade"], found["token"]["grade"]) == ("warning", "good")
            assert "RAY_AUTH_MODE=token" in found["strangers"]["mend"]
            inside = found["MLflow from the head"]
            assert inside["grade"] == "good", inside
            assert f"{uri} answers" in inside["state"]
    assert findings(mine)["MLflow from here"]["grade"] == "fault"


def test_a_cluster_whose_lmtr_cannot_tell(head, lmtr_here, monkeypatch):
    for program, words in ((("lmtr-is-not-here", "x"), "PATH"), (("lmtr", "nonsense"), "older")):
        monkeypatch.setattr(module, "EXAMINE", program)
        status, out, _ = lmtr_here("doctor", "--cluster", "--json")
        assert status == 1
        fault = json.loads(out)["findings"][-1]
        assert (fault["what"], fault["grade"]) == ("a job's answer", "fault")
        assert words in fault["state"]
        assert "image" in fault["mend"]
