"""`lmtr ui`: whether it is about a home or a cluster, and where a cluster's pages are."""

import http.server
import json
import threading
import urllib.error
import urllib.request

import pytest
from tracking_server import mlflow_server
from web import free_port

from pipelines import ui
from services.home import Home
from services.tracking import ui_command

TOKEN = "0123456789abcdef"


@pytest.fixture
def profile(monkeypatch, tmp_path):
    """Writes a user's settings with one profile, which is the default."""
    for name in ("RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH", "LMTR_PROFILE", "LMTR_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("LMTR_SETTINGS", str(tmp_path / "settings.toml"))
    monkeypatch.chdir(tmp_path)
    token = tmp_path / "token"
    token.write_text(TOKEN)

    def write(**settings):
        known = {"cluster": "http://127.0.0.1:1", "token_file": str(token), **settings}
        lines = [f'{name} = "{value}"' for name, value in known.items()]
        text = "\n".join(['profile = "mine"', "[profiles.mine]", *lines])
        (tmp_path / "settings.toml").write_text(text)

    return write


@pytest.fixture
def opened(lmtr, profile, monkeypatch):
    """What `lmtr ui` is about: the home that it would serve, or "cluster"."""
    profile()
    homes = []
    monkeypatch.setattr(ui, "serve", lambda workspace, port: homes.append(str(workspace.home.name)))

    def about(*words):
        homes.clear()
        status, _, said = lmtr(*words)
        if homes:
            assert status == 0
            return homes[0]
        assert status == 2
        # A profile without a server: so far only the choice is looked at.
        return "cluster" if "[profiles.mine]" in said else said

    return about


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    """Address of an MLflow server."""
    with mlflow_server(tmp_path_factory.mktemp("mlflow")) as url:
        yield url


@pytest.mark.slow
@pytest.mark.parametrize("words", [("ui", "--cluster"), ("--profile", "mine", "ui"), ("ui",)])
def test_the_pages_of_a_cluster_are_named_and_the_token_is_not(lmtr, server, profile, words):
    profile(tracking=server)
    status, out, said = lmtr(*words)
    assert status == 0, said
    assert "of profile mine" in said
    assert f"{server}/#/experiments" in said
    assert "http://127.0.0.1:1/#/jobs" in said
    assert "/token (written" in said
    assert TOKEN not in out + said


def status_of(request):
    try:
        return urllib.request.urlopen(request, timeout=10.0).status
    except urllib.error.HTTPError as error:
        return error.code


@pytest.mark.slow
def test_the_server_of_a_homes_page_refuses_other_names_and_other_pages(server, tmp_path):
    # It is started with no more than these, so what is refused is up to MLflow.
    options = ui_command(Home.open(tmp_path / "home", create=True))[4:]
    assert {word for word in options if word.startswith("--")} == {
        *("--backend-store-uri", "--default-artifact-root", "--host", "--port", "--workers")
    }
    for headers, status in (
        ({}, 200),
        ({"Host": "stranger.example"}, 403),
        ({"Origin": "http://stranger.example"}, 403),
    ):
        body = json.dumps({"name": f"of {headers}"}).encode()
        sent = {"Content-Type": "application/json", **headers}
        request = urllib.request.Request(f"{server}/api/2.0/mlflow/experiments/create", body, sent)
        assert status_of(request) == status, headers


def test_a_home_that_is_typed_is_this_machines(opened, tiny_home, monkeypatch):
    assert opened("ui", "--home", tiny_home) == str(tiny_home)
    assert opened("--home", tiny_home, "ui") == str(tiny_home)
    monkeypatch.setenv("LMTR_PROFILE", "mine")
    assert opened("ui", "--home", tiny_home) == str(tiny_home)


def test_a_home_that_is_here_is_meant_unless_a_cluster_is_named(
    opened, tiny_home, monkeypatch, tmp_path
):
    (tmp_path / "lmtr-home").symlink_to(tiny_home)
    assert opened("ui") == str(tmp_path / "lmtr-home")
    assert opened("ui", "--cluster") == "cluster"
    assert opened("--profile", "mine", "ui") == "cluster"
    monkeypatch.setenv("LMTR_PROFILE", "mine")
    assert opened("ui") == "cluster"


def test_without_any_home_it_is_the_cluster_of_the_settings(opened, tiny_home, monkeypatch):
    assert opened("ui") == "cluster"
    monkeypatch.setenv("LMTR_HOME", str(tiny_home))
    assert opened("ui") == str(tiny_home)
    monkeypatch.setenv("LMTR_HOME", "")
    monkeypatch.delenv("LMTR_SETTINGS")
    monkeypatch.setenv("XDG_CONFIG_HOME", "/nowhere")
    assert "no LMTR home" in opened("ui")


@pytest.mark.parametrize("cluster", [("--cluster",), ()])
def test_a_home_and_a_cluster_at_once_are_refused(lmtr, profile, cluster):
    profile()
    before = () if cluster else ("--profile", "mine")
    status, _, said = lmtr(*before, "ui", *cluster, "--home", "there")
    assert status == 2
    assert "the home there" in said


def test_a_profile_without_a_server_says_what_to_write(lmtr, profile):
    profile()
    status, _, said = lmtr("ui", "--cluster")
    assert status == 2
    assert "tracking = " in said
    assert "[profiles.mine]" in said


def test_what_is_no_mlflow_server_is_told(lmtr, profile):
    profile(tracking=f"http://127.0.0.1:{free_port()}")
    assert "Connection refused" in lmtr("ui", "--cluster")[2]
    other = http.server.ThreadingHTTPServer(("127.0.0.1", 0), http.server.SimpleHTTPRequestHandler)
    threading.Thread(target=other.serve_forever, daemon=True).start()
    try:
        profile(tracking=f"http://127.0.0.1:{other.server_port}")
        status, _, said = lmtr("ui", "--cluster")
    finally:
        other.shutdown()
        other.server_close()
    assert status == 2
    assert "no MLflow server" in said
