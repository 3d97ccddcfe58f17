"""A cluster of containers for tests, started as users start it, under a name of its own."""

import json
import os
import re
import secrets
import shutil
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import compose_client
from web import free_ports

from tests.docker.engine import build_environment
from tests.docker.patience import PATIENCE_S, await_true

ROOT = Path(__file__).resolve().parents[2]
ARTIFACTS_MB = 96
"""Size of the disk of artifacts: room for what the tests keep, and soon full."""

IMAGE_USER = 10001
ROLES = ("node", "tracking", "database")
ENDED = ("SUCCEEDED", "FAILED", "STOPPED")


@dataclass(frozen=True)
class Job:
    """A job as the head tells of it.

    Attributes:
        id: Its id.
        status: Ray's word.
        message: What Ray says of it.
    """

    id: str
    status: str
    message: str


class Containers:
    """A cluster of two workers inside a ``with`` statement; nothing of it is left behind.

    Args:
        folder: For its secrets, the user's settings, and the disk of artifacts.

    Attributes:
        up_s: Time that it took from its images to being healthy (s).
        settings: The user's settings file.
    """

    def __init__(self, folder: Path) -> None:
        self._project = f"lmtrtest{secrets.token_hex(3)}"
        self._folder = folder
        self._disk = folder / "artifacts"
        self._head, self._tracking = free_ports(2)
        self.settings = folder / "settings.toml"
        self.up_s = 0.0
        self._docker = compose_client.docker_client()
        files = (ROOT / "docker" / "compose.yaml", ROOT / "docker" / "compose.debian.yaml")
        self._environment = {
            **os.environ,
            **build_environment(ROOT / "docker" / "wheels"),
            "COMPOSE_PROJECT_NAME": self._project,
            "COMPOSE_FILE": os.pathsep.join(
                map(str, (*files, Path(__file__).with_name("compose.test.yaml")))
            ),
            "LMTR_SECRETS": str(folder / "secrets"),
            "LMTR_DOTENV": str(folder / "dotenv"),
            **{f"LMTR_{role.upper()}_IMAGE": self.image(role) for role in ROLES},
            "LMTR_SETTINGS": str(self.settings),
            "LMTR_DASHBOARD_PORT": str(self._head),
            "LMTR_TRACKING_PORT": str(self._tracking),
            "LMTR_TEST_ARTIFACTS": str(self._disk),
        }

    def __enter__(self) -> Self:
        self._disk.mkdir()
        size = f"size={ARTIFACTS_MB}m,mode=0770,uid={IMAGE_USER},gid=0"
        subprocess.run(["mount", "-t", "tmpfs", "-o", size, "lmtr-test", self._disk], check=True)
        try:
            self.command("images")
            said = self.command("up")
        except BaseException:
            self.__exit__()
            raise
        found = re.search(r"healthy after (\d+) s", said)
        assert found is not None, said
        self.up_s = float(found[1])
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(AssertionError):
            self._compose("down", "--volumes", "--remove-orphans", "--timeout", "5")
        subprocess.run(["umount", "--lazy", self._disk], check=False)
        shutil.rmtree(self._folder, ignore_errors=True)

    def command(self, *words: str) -> str:
        """Run what `make cluster` and its fellows run; returns what it prints."""
        command = [sys.executable, str(ROOT / "docker" / "cluster.py"), *words]
        done = subprocess.run(
            command, env=self._environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
        return done.stdout

    def lmtr(self, *words: str) -> subprocess.CompletedProcess[str]:
        """Run a command of the user's, who has the profile that the start has written."""
        environment = {**os.environ, "LMTR_SETTINGS": str(self.settings)}
        return subprocess.run(
            [sys.executable, "-m", "pipelines", *words],
            env=environment,
            cwd=self._folder,
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=False,
        )

    def remake(self, secret: str) -> None:
        """What a user does whose secret has become known: remove it and start the cluster."""
        (self._folder / "secrets" / secret).unlink()
        self.command("up")

    def use_store(self, variables: dict[str, str]) -> None:
        """What a user does whose home is to lie in an object store, or no longer."""
        lines = "".join(f"{name}={value}\n" for name, value in variables.items())
        (self._folder / "secrets" / "storage.env").write_text(lines)
        self.command("up")

    @property
    def token(self) -> str:
        """That of Ray."""
        return (self._folder / "secrets" / "ray_token").read_text().strip()

    @property
    def password(self) -> str:
        """That of PostgreSQL."""
        return (self._folder / "secrets" / "postgres_password").read_text().strip()

    def names(self, service: str = "") -> list[str]:
        """The names of a service's containers, or of all."""
        wanted = [f"label=com.docker.compose.project={self._project}"]
        wanted += [f"label=com.docker.compose.service={service}"] if service else []
        filters = [part for each in wanted for part in ("--filter", each)]
        return sorted(self.docker("ps", "--all", "--format", "{{.Names}}", *filters).split())

    def docker(self, *words: str) -> str:
        """Run the client; returns what it prints."""
        done = subprocess.run([self._docker, *words], capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"docker {' '.join(words)}: {done.stderr}"
        return done.stdout

    def logs(self, container: str) -> str:
        """What a container has said, on both streams."""
        command = [self._docker, "logs", container]
        return subprocess.run(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=True
        ).stdout

    def image(self, role: str) -> str:
        """Name of the image of a role: a user's own is not touched."""
        return f"lmtr-{role}:test"

    def images(self, role: str) -> list[dict[str, Any]]:
        """What the engine knows of the image of a role."""
        return list(json.loads(self.docker("image", "inspect", self.image(role))))

    @property
    def ports(self) -> tuple[int, int]:
        """Of the head and of the tracking server, on this machine."""
        return self._head, self._tracking

    def inspect(self, container: str) -> dict[str, Any]:
        """What the engine knows of a container."""
        (found,) = json.loads(self.docker("inspect", container))
        return found

    def address(self, container: str) -> str:
        """Address on the network of head and workers."""
        return str(
            self.inspect(container)["NetworkSettings"]["Networks"][self.network]["IPAddress"]
        )

    @property
    def network(self) -> str:
        """The network of head and workers."""
        return f"{self._project}_cluster"

    def inside(self, service: str, *command: str) -> str:
        """Run a command in a service's first container."""
        return self.docker("exec", self.names(service)[0], *command)

    def crash(self, container: str) -> None:
        """Kill a container's first process as a crash would, so that its supervisor sees it."""
        os.kill(self.inspect(container)["State"]["Pid"], signal.SIGKILL)

    def ask(self, path: str, body: object = None, token: str | None = "") -> Any:
        """Ask the head; an empty token is the right one, None is none."""
        headers = {"Content-Type": "application/json"}
        if token is not None:
            headers["Authorization"] = f"Bearer {token or self.token}"
        data = None if body is None else json.dumps(body).encode()
        url = f"http://127.0.0.1:{self._head}{path}"
        request = urllib.request.Request(url, data, headers)
        with urllib.request.urlopen(request, timeout=60.0) as answer:
            return json.load(answer)

    def submit(self, entrypoint: str) -> str:
        """Submit a job; returns its id."""
        return str(self.ask("/api/jobs/", {"entrypoint": entrypoint})["submission_id"])

    def job(self, job_id: str) -> Job:
        """How a job is."""
        told = self.ask(f"/api/jobs/{job_id}")
        return Job(job_id, told["status"], told["message"] or "")

    def log(self, job_id: str) -> str:
        """What its driver wrote."""
        return str(self.ask(f"/api/jobs/{job_id}/logs")["logs"])

    def finish(self, job_id: str) -> Job:
        """Wait for the end of a job."""
        await_true(lambda: self.job(job_id).status in ENDED, f"the end of {job_id}")
        return self.job(job_id)

    def alive(self) -> int:
        """How many nodes Ray counts; none while there is no head."""
        with suppress(OSError, ValueError, KeyError, TypeError):
            told = self.ask("/api/v0/nodes")["data"]["result"]["result"]
            return sum(node["state"] == "ALIVE" for node in told)
        return 0

    def await_work(self, job_id: str) -> None:
        """Return when processes of a job work on workers."""

        def works() -> bool:
            job = self.job(job_id)
            assert job.status not in ENDED, f"{job}: {self.log(job_id)[-1500:]}"
            actors = self.ask("/api/v0/actors")["data"]["result"]["result"]
            return any(actor["state"] == "ALIVE" and actor["pid"] for actor in actors)

        await_true(works, f"work of {job_id}")

    def query(self, home: str, sql: str) -> list[dict[str, Any]]:
        """What the lake of a home answers."""
        words = ("lmtr", "--home", home, "query", "--format", "json", sql)
        told = self.inside("head", "ray-node", *words)
        return [dict(row) for row in json.loads(told)]

    def rows(self, home: str) -> list[tuple[int, str]]:
        """Index and digest of all solutions, in order; none before there is a lake."""
        asked = 'SELECT "index", digest FROM solutions ORDER BY ALL'
        try:
            return [(row["index"], row["digest"]) for row in self.query(home, asked)]
        except AssertionError:
            return []

    def commits(self, home: str) -> int:
        """How often solutions were committed: quicker to be seen than rows, while work goes on."""
        look = f"ls {home}/lake/solutions/_delta_log/*.json 2> /dev/null | wc -l"
        return int(self.inside("head", "sh", "-c", look))

    def await_commits(self, home: str, count: int, job_id: str) -> None:
        """Return after so many commits; a job that ends before is none to be disturbed."""

        def enough() -> bool:
            job = self.job(job_id)
            assert job.status not in ENDED, f"{job} too soon: {self.log(job_id)[-1500:]}"
            return self.commits(home) >= count

        await_true(enough, f"{count} commits")

    def await_healthy(self, nodes: int = 3) -> float:
        """Seconds until all containers are healthy and so many nodes are there."""
        began = time.monotonic()

        def healthy() -> bool:
            states = [self.inspect(name)["State"] for name in self.names()]
            well = all(
                state["Status"] == "running" and state["Health"]["Status"] == "healthy"
                for state in states
            )
            return well and self.alive() == nodes

        await_true(healthy, "health")
        return time.monotonic() - began

    def runs(self, experiment: str) -> list[dict[str, Any]]:
        """All runs of an experiment in MLflow: name, status, tags, metrics."""
        found = self.mlflow("experiments/get-by-name?experiment_name=" + experiment)
        wanted = {"experiment_ids": [found["experiment"]["experiment_id"]], "max_results": 500}
        return list(self.mlflow("runs/search", wanted).get("runs", []))

    def mlflow(self, path: str, body: object = None) -> Any:
        """Ask the tracking server."""
        url = f"http://127.0.0.1:{self._tracking}/api/2.0/mlflow/{path}"
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(url, data, {"Content-Type": "application/json"})
        with urllib.request.urlopen(request, timeout=60.0) as answer:
            return json.load(answer)

    def files(self, run_id: str) -> list[str]:
        """Paths of the files that a run keeps."""
        told = self.mlflow(f"artifacts/list?run_id={run_id}")
        return [file["path"] for file in told.get("files", [])]

    def fill_artifacts(self) -> Callable[[], None]:
        """Leave no room on the disk of artifacts; returns what makes room again."""
        filler = self._disk / "filler"
        with suppress(OSError), filler.open("wb", buffering=0) as file:
            while True:
                file.write(bytes(1 << 16))
        return filler.unlink

    def memory_mb(self) -> dict[str, float]:
        """Memory that each container holds, without what is only cached (MB)."""
        units = {"KiB": 1 / 1024, "MiB": 1.0, "GiB": 1024.0}
        told = self.docker("stats", "--no-stream", "--format", "{{.Name}} {{.MemUsage}}")
        used = {}
        for line in told.splitlines():
            name, amount = line.split()[:2]
            found = re.fullmatch(r"([\d.]+)([KMG]iB)", amount)
            if found is not None and name in self.names():
                used[name] = float(found[1]) * units[found[2]]
        return used

    def _compose(self, *words: str) -> None:
        files = self._environment["COMPOSE_FILE"].split(os.pathsep)
        command = compose_client.compose_command(self._docker)
        command += ["--project-directory", str(ROOT / "docker")]
        command += [part for file in files for part in ("--file", file)]
        done = subprocess.run(
            [*command, *words], env=self._environment, capture_output=True, check=False
        )
        assert done.returncode == 0, done.stderr.decode(errors="replace")[-2000:]
