"""Docker and Compose as they are installed here, whichever of their versions that is."""

import json
import os
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
COMPOSE_FILE = HERE / "compose.yaml"

CLOSED_LOOPBACK = 28
"""The first release of the engine that keeps 127.0.0.1 to its machine (moby#45610)."""


class ToolError(Exception):
    """What is needed is missing or failed; the message says how to mend it."""


def docker_client() -> str:
    """A client that can build images: not every `docker` on the path has what that takes.

    ``DOCKER`` names another one.
    """
    if named := os.environ.get("DOCKER"):
        return named
    folders = os.environ.get("PATH", os.defpath).split(os.pathsep)
    found = [path for folder in folders if (path := shutil.which("docker", path=folder))]
    if not found:
        raise ToolError("docker is not installed; see https://docs.docker.com/engine/install")
    return next(filter(_builds, found), found[0])


@dataclass(frozen=True)
class Engine:
    """What an engine says of itself.

    Attributes:
        version: Its release, ``28.0.1``.
        processors: How many its containers can have.
        shares_processors: Whether a container's part of them can be limited.
    """

    version: str
    processors: int
    shares_processors: bool = True

    @property
    def leaks_loopback(self) -> bool:
        """Whether neighbours on a network segment reach what is published on 127.0.0.1."""
        major = self.version.partition(".")[0]
        return major.isdigit() and int(major) < CLOSED_LOOPBACK


def find_engine(docker: str) -> Engine:
    """The engine that answers.

    Raises:
        ToolError: None does.
    """
    asked = _said([docker, "info", "--format", "{{json .}}"])
    return engine_of(asked.stdout, asked.stderr)


def engine_of(told: str, complaint: str = "") -> Engine:
    """The engine that a client's ``info`` tells of; some clients succeed without one.

    Raises:
        ToolError: As `find_engine`.
    """
    try:
        info = json.loads(told)
    except json.JSONDecodeError:
        info = {}
    if not info.get("ServerVersion"):
        reasons = [*(info.get("ServerErrors") or ()), *complaint.strip().splitlines()[-1:]]
        raise ToolError(
            f"no Docker engine answers ({reasons[0] if reasons else 'no reason given'}); start it, "
            "or ask for permission to use it"
        )
    return Engine(info["ServerVersion"], info["NCPU"], info.get("CpuCfsQuota", True))


def compose_command(docker: str) -> list[str]:
    """Compose as the client's plugin, else the program of its own."""
    plugin = [docker, "compose"]
    if succeeds([*plugin, "version"]):
        return plugin
    if program := shutil.which("docker-compose"):
        return [program]
    raise ToolError("Docker Compose is not installed; see https://docs.docker.com/compose/install")


def succeeds(command: Sequence[str]) -> bool:
    """Whether a command does, whatever it prints."""
    return _said(command).returncode == 0


def run(command: Sequence[str], environment: Mapping[str, str] | None = None) -> None:
    """Run a command to its end.

    Raises:
        ToolError: It failed; its own words came before.
    """
    done = subprocess.run(command, env=environment, check=False)
    if done.returncode:
        raise ToolError(f"`{' '.join(command[:4])} …` failed with status {done.returncode}")


def output(command: Sequence[str], environment: Mapping[str, str] | None = None) -> str:
    """What a command prints.

    Raises:
        ToolError: It failed.
    """
    done = _said(command, environment)
    if done.returncode:
        raise ToolError(f"`{' '.join(command[:4])} …` failed: {done.stderr.strip()}")
    return done.stdout


def _builds(docker: str) -> bool:
    """With buildx, or of a time when BuildKit was in the client itself."""
    version = _said([docker, "version", "--format", "{{.Client.Version}}"]).stdout.strip()
    major = version.partition(".")[0]
    old = major.isdigit() and int(major) < 23
    return old or succeeds([docker, "buildx", "version"])


def _said(
    command: Sequence[str], environment: Mapping[str, str] | None = None
) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
