"""A cluster, a user of it, and the data set that all ways of making it must come to."""

import json
import os
import signal
import subprocess
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
from ray_head import RayHead

from tests.faults.driver import CONFIGURATION, PATIENCE_S, arguments, committed, finish, rows
from tests.pipelines.conftest import run_main

COUNT = 240
"""Solutions of a data set: enough for commands to be typed while it is made."""

WALKS = f"{CONFIGURATION}\n".replace("solutions = 64", f"solutions = {COUNT}")


@dataclass(frozen=True)
class User:
    """Somebody at a client of the cluster.

    Attributes:
        folder: Where commands are typed.
        environment: Variables of the shell.
    """

    folder: Path
    environment: Mapping[str, str]

    def types(self, *words: object) -> "subprocess.CompletedProcess[str]":
        """Run a command to its end."""
        return subprocess.run(arguments(*words), **self._options(), timeout=PATIENCE_S, check=False)

    def starts(self, *words: object) -> "subprocess.Popen[str]":
        """Run a command and go on."""
        return subprocess.Popen(arguments(*words), **self._options())

    def submits(self, *words: object) -> str:
        """Submit, and return the id."""
        done = self.types("submit", *words)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    def job(self, job_id: str) -> dict[str, Any]:
        """What `lmtr jobs` tells of a job."""
        done = self.types("jobs", "--json")
        assert done.returncode == 0, done.stderr
        (found,) = [job for job in json.loads(done.stdout) if job["id"] == job_id]
        return found

    def _options(self) -> dict[str, Any]:
        return {
            "cwd": self.folder,
            "env": {**self.environment, "PYTHONUNBUFFERED": "1"},
            "stdout": subprocess.PIPE,
            "stderr": subprocess.PIPE,
            "text": True,
        }


@pytest.fixture(scope="session", autouse=True)
def machine_cache(tmp_path_factory):
    """A cache of compiled experts for the cluster and for what it is compared with."""
    folder = tmp_path_factory.mktemp("machine") / "cache"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LMTR_CACHE", str(folder))
        # Where the tests' interpreter finds the code, the cluster's must find it too.
        here = [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")]
        patch.setenv("PYTHONPATH", os.pathsep.join(here))
        yield folder


@pytest.fixture(scope="module")
def cluster_home(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("cluster") / "home"


@pytest.fixture(scope="module")
def head(tmp_path_factory, cluster_home):
    if why := RayHead.obstacle():
        pytest.skip(why)
    with RayHead(tmp_path_factory.mktemp("head"), cluster_home) as running:
        yield running


@pytest.fixture
def user(head, tmp_path) -> User:
    (tmp_path / "walks.toml").write_text(WALKS)
    return User(tmp_path, head.client)


@pytest.fixture
def lmtr_here(head, monkeypatch, capsys):
    """The command line in this process: exit status, standard output and standard error."""

    def call(*words: object) -> tuple[int, str, str]:
        capsys.readouterr()
        status = run_main(monkeypatch, *words)
        return status, *capsys.readouterr()

    for name in [name for name in os.environ if name.startswith("RAY_AUTH")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("LMTR_SETTINGS", str(head.settings))
    return call


@pytest.fixture(scope="session")
def reference(tmp_path_factory) -> pa.Table:
    """The rows as this machine makes them without a cluster."""
    folder = tmp_path_factory.mktemp("undisturbed")
    config = folder / "walks.toml"
    config.write_text(WALKS)
    finish(folder / "home", config)
    return rows(folder / "home")


def await_rows(home: Path, count: int) -> None:
    """Return when the cluster's lake holds so many rows."""
    until = time.monotonic() + PATIENCE_S
    while committed(home) < count:
        assert time.monotonic() < until, f"there were never {count} rows"
        time.sleep(0.05)


def interrupted(process: "subprocess.Popen[str]") -> tuple[int, str]:
    """Type Ctrl-C at a command: its exit status and standard error."""
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=PATIENCE_S)
    return process.returncode, err
