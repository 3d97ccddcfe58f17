"""The head of a Ray cluster with dashboard and token, for tests, gone after its block.

with RayHead(folder, home) as head:
lmtr("jobs", environment=head.client)
head.power_off()
head.start()
"""

import os
import secrets
import shutil
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Self

import psutil
from web import free_ports

from benchmarks.processes import end_all, family, left_over
from services.cluster.ray_cluster import ENVIRONMENT

PATIENCE_S = 180.0
"""A head that does not answer after so long never will."""

ENDING_S = 20.0

PORTS = (
    "--port",
    "--dashboard-port",
    "--dashboard-agent-listen-port",
    "--dashboard-agent-grpc-port",
    "--metrics-export-port",
    "--ray-client-server-port",
)
"""Ports whose defaults another Ray on this machine has."""

AGENT_PORTS = PORTS[2:5]
"""Those of them that a node without a head has too."""


class RayHead:
    """A head that runs inside a ``with`` statement.

    Args:
        folder: For the token, the settings of a user, and the log.
        home: ``LMTR_HOME`` of its machine.
        cpus: Processors that it offers.
        closed: Whether it wants a token.

    Attributes:
        token_file: With the token that it has now.
        settings: A user's settings file whose default profile is this head.
    """

    def __init__(self, folder: Path, home: Path, cpus: int = 2, *, closed: bool = True) -> None:
        self._log = folder / "head.log"
        self._home = home
        self._cpus = cpus
        self._closed = closed
        self._process: subprocess.Popen[bytes] | None = None
        self._temporary = ""
        self._seen: dict[int, psutil.Process] = {}
        self._ports = dict(zip(PORTS, free_ports(len(PORTS)), strict=True))
        self.token_file = folder / "token"
        self.settings = folder / "settings.toml"
        self.settings.write_text(
            'profile = "test"\n[profiles.test]\n'
            f'cluster = "{self.url}"\ntoken_file = "{self.token_file}"\nhome = "{home}"\n'
        )

    @staticmethod
    def obstacle() -> str:
        """Why there can be no such head here; empty if there can."""
        try:
            import ray.dashboard.optional_deps  # noqa: F401 - all that a dashboard needs
        except ImportError as error:
            return f"Ray's dashboard cannot run: {error}; install with: pip install -e '.[dev]'"
        return ""

    @property
    def url(self) -> str:
        """Of its dashboard."""
        return f"http://127.0.0.1:{self._ports['--dashboard-port']}"

    @property
    def client(self) -> dict[str, str]:
        """The environment of a user whose settings name this head."""
        theirs = ("RAY_", "LMTR_HOME", "LMTR_PROFILE")
        kept = {name: value for name, value in os.environ.items() if not name.startswith(theirs)}
        return {**kept, "LMTR_SETTINGS": str(self.settings), "COLUMNS": "200"}

    def __enter__(self) -> Self:
        try:
            self.start()
        except BaseException:
            self.power_off()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.power_off()

    def start(self) -> None:
        """Start it, with a token that no other start had, and wait until it can take jobs."""
        self.token_file.unlink(missing_ok=True)
        self.token_file.touch(mode=0o600)
        self.token_file.write_text(secrets.token_hex(32))
        # Ray's sockets lie in here, and the path of a socket may have 107 characters at most.
        self._temporary = tempfile.mkdtemp(prefix="lmtrj-", dir="/tmp")
        command = [
            str(Path(sys.executable).with_name("ray")),
            *("start", "--head", "--block", "--disable-usage-stats"),
            *("--dashboard-host=127.0.0.1", "--node-ip-address=127.0.0.1"),
            *(f"{option}={port}" for option, port in self._ports.items()),
            *(f"--num-cpus={self._cpus}", "--object-store-memory=100000000"),
            # Ray opens it to all users of the machine; the folder around it stays closed.
            f"--temp-dir={self._temporary}/r",
        ]
        with self._log.open("ab") as log:
            self._process = subprocess.Popen(
                command, stdout=log, stderr=log, env=self._environment(), start_new_session=True
            )
        self._await()

    def power_off(self) -> None:
        """End all of it at once, and whatever it started."""
        if self._process is not None:
            self.look()
            members = list(self._seen.values())
            end_all(members)
            self._process.wait()
            left = left_over(members, ENDING_S)
            self._process, self._seen = None, {}
            shutil.rmtree(self._temporary, ignore_errors=True)
            assert left == [], left

    @contextmanager
    def worker(self, cpus: int, environment: Mapping[str, str | None]) -> Iterator[None]:
        """Another node of the cluster on this machine, there for the block.

        Args:
            cpus: Processors that it offers.
            environment: Variables that differ on its machine; None for one that it lacks.
        """
        agents = dict(zip(AGENT_PORTS, free_ports(len(AGENT_PORTS)), strict=True))
        command = [
            str(Path(sys.executable).with_name("ray")),
            *("start", "--block", "--disable-usage-stats", "--node-ip-address=127.0.0.1"),
            f"--address=127.0.0.1:{self._ports['--port']}",
            *(f"{option}={port}" for option, port in agents.items()),
            *(f"--num-cpus={cpus}", "--object-store-memory=100000000"),
        ]
        theirs = {**self._environment(), **environment}
        kept = {name: value for name, value in theirs.items() if value is not None}
        with self._log.open("ab") as log:
            process = subprocess.Popen(
                command, stdout=log, stderr=log, env=kept, start_new_session=True
            )
        try:
            self._await(nodes=2)
            yield
        finally:
            members = family(process.pid)
            end_all(members)
            process.wait()
            left = left_over(members, ENDING_S)
            assert left == [], left
            self._await()

    def look(self) -> None:
        """Note all processes there are, so that those which lose their parent are found too."""
        if self._process is not None:
            self._seen.update((each.pid, each) for each in family(self._process.pid))

    def _environment(self) -> Mapping[str, str]:
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
        return {
            **{name: value for name, value in os.environ.items() if not name.startswith("RAY_")},
            **ENVIRONMENT,
            "RAY_AUTH_MODE": "token" if self._closed else "disabled",
            "RAY_AUTH_TOKEN_PATH": str(self.token_file),
            "LMTR_HOME": str(self._home),
            "PATH": path,
        }

    def _await(self, nodes: int = 1) -> None:
        """Wait until the head knows so many nodes; without its own it refuses jobs."""
        request = urllib.request.Request(
            f"{self.url}/api/v0/nodes",
            headers={"Authorization": f"Bearer {self.token_file.read_text()}"},
        )
        until = time.monotonic() + PATIENCE_S
        while time.monotonic() < until:
            self.look()
            assert self._process is not None
            assert self._process.poll() is None, self._told()
            with suppress(urllib.error.URLError, OSError):
                told = urllib.request.urlopen(request, timeout=5.0).read().decode()
                if told.count('"ALIVE"') == nodes:
                    return
            time.sleep(0.3)
        raise AssertionError(f"no head at {self.url}: {self._told()}")

    def _told(self) -> str:
        return self._log.read_text(errors="replace")[-2000:]
