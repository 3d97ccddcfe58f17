"""A head that shall end tells its jobs first, however busy it is."""

import http.server
import importlib.machinery
import importlib.util
import json
import threading
from collections import Counter
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "docker" / "entrypoints" / "drain-jobs"


class Head(http.server.ThreadingHTTPServer):
    """A head with one job that begins late and one that runs, which fails its first answer."""

    def __init__(self):
        super().__init__(("127.0.0.1", 0), Answers)
        self.asked = Counter()
        self.status = {"late": "PENDING", "long": "RUNNING"}

    def answer(self, method, path):
        self.asked[method, path] += 1
        if (method, path) == ("GET", "/api/jobs/"):
            if self.asked[method, path] == 1:
                return 500, "busy"
            return 200, [{"submission_id": j, "status": s} for j, s in self.status.items()]
        job = path.split("/")[3]
        if job == "late" and self.asked[method, path] == 1:
            return 200, {"stopped": False}
        self.status[job] = "STOPPED"
        return 200, {"stopped": True}


class Answers(http.server.BaseHTTPRequestHandler):
    def reply(self):
        assert self.headers["Authorization"] == "Bearer secret"
        status, body = self.server.answer(self.command, self.path)
        self.send_response(status)
        self.end_headers()
        self.wfile.write(json.dumps(body).encode())

    do_GET = do_POST = reply

    def log_message(self, *_):
        pass


@pytest.fixture
def head():
    server = Head()
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield server
    server.shutdown()
    server.server_close()


@pytest.fixture
def drain(head, tmp_path, monkeypatch):
    """The script, which asks that head."""
    (tmp_path / "token").write_text("secret\n")
    monkeypatch.setenv("RAY_AUTH_TOKEN_PATH", str(tmp_path / "token"))
    loader = importlib.machinery.SourceFileLoader("drain_jobs", str(SCRIPT))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("drain_jobs", loader))
    monkeypatch.setattr("sys.dont_write_bytecode", True)
    loader.exec_module(module)
    monkeypatch.setattr(module, "HEAD", f"http://127.0.0.1:{head.server_port}/api/jobs/")
    return module.main


def test_every_job_is_told_though_the_head_is_busy_and_one_begins_late(head, drain, capsys):
    drain()
    assert set(head.status.values()) == {"STOPPED"}
    assert head.asked["POST", "/api/jobs/late/stop"] == 2
    assert head.asked["POST", "/api/jobs/long/stop"] == 1
    assert capsys.readouterr().out.endswith("drain-jobs: 2 jobs stopped, 0 still run\n")


def test_it_gives_up_after_its_time(head, drain, monkeypatch, capsys):
    monkeypatch.setenv("RAY_JOB_STOP_WAIT_TIME_S", "-9")
    monkeypatch.setattr(head, "answer", lambda *_: (500, "busy"))
    drain()
    assert capsys.readouterr().out.endswith("0 jobs stopped, ? still run\n")
