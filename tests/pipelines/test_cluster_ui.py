"""`lmtr ui --cluster`: where a cluster's pages are, or why that cannot be said."""

import http.server
import os
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from contextlib import suppress

import pytest


@pytest.fixture
def profile(monkeypatch, tmp_path):
    """Writes a user's settings with one profile, which is the default."""
    for name in ("RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH", "LMTR_PROFILE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("LMTR_SETTINGS", str(tmp_path / "settings.toml"))
    token = tmp_path / "token"
    token.write_text("0123456789abcdef")

    def write(**settings):
        known = {"cluster": "http://127.0.0.1:1", "token_file": str(token), **settings}
        lines = [f'{name} = "{value}"' for name, value in known.items()]
        text = "\n".join(['profile = "mine"', "[profiles.mine]", *lines])
        (tmp_path / "settings.toml").write_text(text)

    return write


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    """Address of an MLflow server."""
    port = free_port()
    folder = tmp_path_factory.mktemp("mlflow")
    command = [sys.executable, "-m", "mlflow", "server", "--port", str(port), "--workers", "1"]
    command += ["--backend-store-uri", f"sqlite:///{folder}/runs.db"]
    environment = {**os.environ, "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false"}
    process = subprocess.Popen(command, start_new_session=True, env=environment, cwd=folder)
    url = f"http://127.0.0.1:{port}"
    try:
        until = time.monotonic() + 120.0
        while not answers(url):
            assert process.poll() is None
            assert time.monotonic() < until
            time.sleep(0.2)
        yield url
    finally:
        os.killpg(process.pid, 15)
        process.wait(timeout=30)


def answers(url):
    with suppress(OSError):
        return urllib.request.urlopen(f"{url}/health", timeout=2.0).status == 200
    return False


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.mark.slow
@pytest.mark.parametrize("words", [("ui", "--cluster"), ("--profile", "mine", "ui")])
def test_the_pages_of_a_cluster_are_named_and_the_token_is_not(lmtr, server, profile, words):
    profile(tracking=server)
    status, out, said = lmtr(*words)
    assert status == 0, said
    assert f"{server}/#/experiments" in said
    assert "http://127.0.0.1:1/#/jobs" in said
    assert "0123456789abcdef" not in out + said


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
