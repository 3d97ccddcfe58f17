"""Docker and Compose as they are installed here, whichever of their versions that is."""

import os
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

HERE = Path(__file__).resolve().parent
COMPOSE_FILE = HERE / "compose.yaml"


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


def require_engine(docker: str) -> None:
    """Refuse to go on without an engine that answers."""
    asked = _said([docker, "info", "--format", "{{.ServerVersion}}"])
    if asked.returncode:
        reason = (asked.stderr.strip() or asked.stdout.strip()).splitlines()
        raise ToolError(
            f"no Docker engine answers ({reason[-1] if reason else 'no reason given'}); start it, "
            "or ask for permission to use it"
        )


def compose_command(docker: str) -> list[str]:
    """Compose as the client's plugin, else the program of its own."""
    plugin = [docker, "compose"]
    if _said([*plugin, "version"]).returncode == 0:
        return plugin
    if program := shutil.which("docker-compose"):
        return [program]
    raise ToolError("Docker Compose is not installed; see https://docs.docker.com/compose/install")


def compose_files() -> list[Path]:
    """Those that ``COMPOSE_FILE`` names, else the one beside this file."""
    given = os.environ.get("COMPOSE_FILE", "")
    separator = os.environ.get("COMPOSE_PATH_SEPARATOR", os.pathsep)
    return [Path(name) for name in given.split(separator) if name] or [COMPOSE_FILE]


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
    return old or _said([docker, "buildx", "version"]).returncode == 0


def _said(
    command: Sequence[str], environment: Mapping[str, str] | None = None
) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
