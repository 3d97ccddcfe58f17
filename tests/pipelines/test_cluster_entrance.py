"""What `lmtr doctor --cluster` finds before the cluster lets it in."""

import http.server
import json
import socket

import pytest
from web import served

from pipelines.checkup.entrance import judged_secrecy
from pipelines.checkup.finding import Grade
from pipelines.checkup.home import examined_home, examined_tracker
from pipelines.checkup.machine import told
from pipelines.checkup.report import MachineReport
from services.cluster.token import Token
from services.home import Home


class Page(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_response(200)
        self.end_headers()
        self.wfile.write(b"<html>hello</html>")


@pytest.fixture
def nobody() -> str:
    """An address on which nothing listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"http://127.0.0.1:{probe.getsockname()[1]}"


@pytest.fixture
def profile(monkeypatch, tmp_path):
    """Writes a user's settings with one profile."""
    for name in ("RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH", "LMTR_PROFILE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("LMTR_SETTINGS", str(tmp_path / "settings.toml"))
    monkeypatch.setenv("COLUMNS", "400")

    def write(**settings: str) -> None:
        lines = [f'{name} = "{value}"' for name, value in settings.items()]
        text = "\n".join(['profile = "mine"', "[profiles.mine]", *lines])
        (tmp_path / "settings.toml").write_text(text)

    return write


def findings(lmtr, *words):
    status, out, _ = lmtr("doctor", "--cluster", *words, "--json")
    told = json.loads(out)
    assert told["healthy"] == (status == 0)
    return status, told["findings"]


def test_nothing_listens(lmtr, profile, nobody):
    profile(cluster=nobody)
    status, out, _ = lmtr("doctor", "--cluster")
    assert status == 1
    assert "✗" in out
    assert "Connection refused" in out
    assert "check that the cluster runs" in out


def test_a_name_that_nobody_has(lmtr, profile):
    status, (found,) = findings(lmtr, "http://nobody.invalid:8265")
    assert (status, found["grade"]) == (1, "fault")
    assert "cannot be reached" in found["state"]


def test_the_wrong_port(lmtr, profile):
    with served(Page) as url:
        status, (found,) = findings(lmtr, url)
    assert status == 1
    assert "is no Ray dashboard" in found["state"]
    assert "8265" in found["mend"]


def test_the_mlflow_server_is_looked_at_even_if_the_cluster_is_lost(lmtr, profile, nobody):
    with served(Page) as other:
        profile(cluster=nobody, tracking=other)
        status, (_, tracking) = findings(lmtr)
        assert status == 1
        assert (tracking["what"], tracking["grade"]) == ("MLflow from here", "fault")
        assert "no MLflow server" in tracking["state"]
    profile(cluster=nobody, tracking=nobody)
    _, (_, tracking) = findings(lmtr)
    assert "Connection refused" in tracking["state"]
    assert "check that the MLflow server runs" in tracking["mend"]


def test_a_token_that_cannot_be_read_and_a_profile_that_is_not_there(lmtr, profile, tmp_path):
    profile(cluster="http://127.0.0.1:9", token_file=f"{tmp_path}/absent")
    status, (found,) = findings(lmtr)
    assert status == 1
    assert f"{tmp_path}/absent cannot be read (No such file or directory)" in found["state"]
    assert "copy the token" in found["mend"]
    status, out, _ = lmtr("--profile", "other", "doctor", "--cluster")
    assert status == 1
    assert "choose one of: mine" in out


def test_what_is_typed_must_make_sense(lmtr, profile):
    status, _, err = lmtr("doctor", "http://127.0.0.1:9")
    assert status == 2
    assert "put --cluster before it" in err
    status, _, err = lmtr("doctor", "--cluster", "--set", "cluster.workers=1")
    assert status == 2
    assert "about this machine" in err


def secrecy(url, token=None, *, closed=True):
    return {each.subject: each for each in judged_secrecy(url, token, closed=closed)}


def test_who_may_come_in_is_told():
    assert secrecy("http://127.0.0.1:8265")["strangers"].grade is Grade.GOOD
    strangers = secrecy("http://127.0.0.1:8265", closed=False)["strangers"]
    assert strangers.grade is Grade.WARNING
    assert "can run any program" in strangers.state
    assert "RAY_AUTH_MODE=token" in strangers.mend


@pytest.mark.parametrize(
    ("url", "named"),
    [
        ("http://10.0.0.1:8265", True),
        ("https://10.0.0.1:8265", False),
        ("http://localhost:8265", False),
        ("http://[::1]:8265", False),
        ("http://127.0.0.1:8265", False),
    ],
)
def test_a_token_that_travels_in_the_clear_is_told(url, named):
    found = secrecy(url, Token("secret", "a test"))
    assert ("encryption" in found) is named
    assert "encryption" not in secrecy(url)


@pytest.mark.parametrize(("mode", "named"), [(0o600, False), (0o640, True), (0o604, True)])
def test_a_token_file_that_others_can_read_is_told(tmp_path, mode, named):
    file = tmp_path / "token"
    file.write_text("secret")
    file.chmod(mode)
    found = secrecy("http://127.0.0.1:8265", Token.read(file))
    assert ("token file" in found) is named
    if named:
        assert f"(mode {mode:04o})" in found["token file"].state
        assert found["token file"].mend == f"chmod 600 {file}"


def test_a_node_tells_what_it_has(machine_cache, monkeypatch, tmp_path):
    monkeypatch.delenv("RAY_health_check_period_ms", raising=False)
    monkeypatch.setenv("RAY_health_check_timeout_ms", "2000")
    machine = MachineReport.model_validate_json(told(str(tmp_path)))
    assert machine.sees_home
    assert "RAY_health_check_period_ms" in machine.unset
    assert "RAY_health_check_timeout_ms" not in machine.unset
    assert machine.cache.path == str(machine_cache)
    assert machine.temporary.free > 0
    assert MachineReport.model_validate_json(told(f"{tmp_path}/absent")).sees_home is False


def test_a_home_is_looked_at_and_left_as_it_is(tmp_path):
    absent = tmp_path / "home"
    with examined_home(str(absent)) as (report, mark):
        assert (report.known, report.fault, mark) == (False, "", "")
    assert list(tmp_path.iterdir()) == []
    Home.open(absent, create=True)
    before = sorted(absent.iterdir())
    with examined_home(str(absent)) as (report, mark):
        assert (report.known, report.fault) == (True, "")
        assert MachineReport.model_validate_json(told(mark)).sees_home
    assert sorted(absent.iterdir()) == before


def test_a_home_that_jobs_would_refuse_is_a_fault(tmp_path):
    (tmp_path / "foreign").write_text("mine")
    with examined_home(str(tmp_path)) as (report, mark):
        assert "holds other things ('foreign'" in report.fault
        assert mark == ""
    with examined_home(str(tmp_path / "foreign" / "below")) as (report, _):
        assert report.fault
    with examined_home("") as (report, _):
        assert report.place == ""


def test_a_home_in_a_store_is_looked_at_before_it_is_there(moto, reach, prefix, monkeypatch):
    from s3_servers import BUCKET, dropping_conditions

    reach(moto)
    place = f"s3://{BUCKET}/{prefix}/home"
    for known in (False, True):
        with examined_home(place) as (report, mark):
            assert (report.remote, report.known, report.fault, mark) == (True, known, "", "")
            assert report.seconds > 0.0
        Home.open(place, create=True)
    with dropping_conditions(moto) as loose:
        reach(loose)
        with examined_home(place) as (report, _):
            assert "two writers would overwrite one another's commits" in report.fault
    reach(moto)
    with examined_home("s3://no-such-bucket/home") as (report, _):
        assert "the bucket does not exist" in report.fault


def test_the_tracker_is_that_which_a_job_would_use(monkeypatch, nobody):
    monkeypatch.delenv("LMTR_TRACKING", raising=False)
    monkeypatch.setenv("MLFLOW_TRACKING_URI", nobody)
    assert examined_tracker("/data/home").uri == ""
    assert "Connection refused" in examined_tracker("s3://bucket/home").fault
    with_password = nobody.replace("://", "://me:secret@")
    monkeypatch.setenv("LMTR_TRACKING", with_password)
    report = examined_tracker("/data/home")
    assert report.is_server
    assert "secret" not in report.model_dump_json()
