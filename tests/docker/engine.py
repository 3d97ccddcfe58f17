"""A Docker engine for tests: the one that runs, else one that is started and ended again.

The base image is made of Debian's packages once per machine, since no registry may be in reach.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import compose_client

BASE_IMAGE = "lmtr-test-base:bookworm"
MIRROR = "http://deb.debian.org/debian"
ENGINE_S = 60.0

AUTHORITIES = ("PIP_CERT", "SSL_CERT_FILE", "REQUESTS_CA_BUNDLE")
"""Variables that name the certificate authority which a machine trusts beside the usual ones."""

UNNEEDED = ("var/cache/apt", "var/lib/apt/lists", "usr/share/doc", "usr/share/man")


def obstacle() -> str:
    """Why there can be no cluster of containers here; empty if there can."""
    try:
        docker = compose_client.docker_client()
        compose_client.compose_command(docker)
    except compose_client.ToolError as error:
        return str(error)
    if not answers(docker):
        if os.geteuid() != 0 or shutil.which("dockerd") is None:
            return "no Docker engine answers, and none can be started (root and dockerd)"
        if shutil.which("iptables") is None:
            return "no Docker engine answers, and iptables, which one needs, is not installed"
    if not has_image(docker, BASE_IMAGE) and (os.geteuid() != 0 or not shutil.which("debootstrap")):
        return "the base image cannot be made (root and debootstrap)"
    return ""


@contextmanager
def engine() -> Iterator[str]:
    """The client of an engine that runs inside the block."""
    docker = compose_client.docker_client()
    if answers(docker):
        yield docker
        return
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen(["dockerd"], stdout=log, stderr=log, start_new_session=True)
        try:
            until = time.monotonic() + ENGINE_S
            while not answers(docker):
                log.seek(0)
                assert process.poll() is None, log.read()[-2000:].decode(errors="replace")
                assert time.monotonic() < until, "the engine does not answer"
                time.sleep(0.5)
            yield docker
        finally:
            process.terminate()
            process.wait(timeout=ENGINE_S)


def answers(docker: str) -> bool:
    """Whether an engine does."""
    with suppress(compose_client.ToolError):
        return bool(compose_client.find_engine(docker).version)
    return False


def has_image(docker: str, image: str) -> bool:
    """Whether the engine has it."""
    command = [docker, "image", "inspect", image]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def require_base(docker: str) -> None:
    """Make the base image unless it is there: a Debian with Python, two minutes."""
    if has_image(docker, BASE_IMAGE):
        return
    with tempfile.TemporaryDirectory(prefix="lmtr-base-") as scratch:
        root = Path(scratch, "root")
        packages = "--include=python3-venv,ca-certificates"
        command = ["debootstrap", "--variant=minbase", packages, "bookworm", str(root), MIRROR]
        with Path(scratch, "log").open("w+b") as log:
            done = subprocess.run(command, stdout=log, stderr=log, check=False)
            log.seek(0)
            assert done.returncode == 0, log.read()[-2000:].decode(errors="replace")
        for folder in UNNEEDED:
            shutil.rmtree(root / folder, ignore_errors=True)
        (root / "var/lib/apt/lists").mkdir(parents=True, exist_ok=True)
        (root / "var/cache/apt/archives/partial").mkdir(parents=True, exist_ok=True)
        (root / "usr/share/man/man1").mkdir(parents=True, exist_ok=True)
        packed = subprocess.Popen(
            ["tar", "--directory", str(root), "--create", "."], stdout=subprocess.PIPE
        )
        subprocess.run([docker, "import", "-", BASE_IMAGE], stdin=packed.stdout, check=True)
        assert packed.wait() == 0


def build_environment(wheels: Path) -> dict[str, str]:
    """What a build needs on this machine; wheels that only its own pip finds are laid out."""
    environment = {"BASE_IMAGE": BASE_IMAGE}
    for name in AUTHORITIES:
        if os.environ.get(name):
            environment["BUILD_CA"] = os.environ[name]
            break
    if _cpu_torch(wheels):
        environment["TORCH_INDEX"] = ""
    return environment


def _cpu_torch(wheels: Path) -> bool:
    """Whether torch for processors alone lies among the wheels, fetched if pip here finds it."""
    if any(wheels.glob("torch-*+cpu-*.whl")):
        return True
    pinned = Path(__file__).parents[2] / "constraints.txt"
    (version,) = (line for line in pinned.read_text().splitlines() if line.startswith("torch=="))
    with tempfile.TemporaryDirectory() as scratch:
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps"]
        with suppress(subprocess.CalledProcessError):
            subprocess.run([*command, "--dest", scratch, version], check=True, capture_output=True)
        for wheel in Path(scratch).glob("torch-*+cpu-*.whl"):
            shutil.copy(wheel, wheels)
            return True
    return False
