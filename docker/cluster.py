"""Start and stop the cluster of containers on this machine: `make cluster`, `make cluster-down`.

python docker/cluster.py up|down|images|config

The standard library alone, so that it runs before anything is installed.
"""

import argparse
import os
import re
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

import compose_settings
from compose_client import (
    CLOSED_LOOPBACK,
    HERE,
    Engine,
    ToolError,
    compose_command,
    compose_files,
    docker_client,
    find_engine,
    output,
    run,
)
from preparation import container_user, make_secrets, use_storage
from user_profile import settings_file, write_profile

ROOT = HERE.parent
DOTENV = Path(os.environ.get("LMTR_DOTENV") or HERE / ".env")
PROJECT = "lmtr"
PATIENCE_S = 300.0
"""How long containers may take until they are healthy."""

HEALTHY = (("running", "healthy"), ("exited", "none"))
"""Statuses and health of containers that do their part, or had one to do and have done it."""

ROLES = ("node", "tracking")
IMAGES = {
    "node": "LMTR_NODE_IMAGE",
    "tracking": "LMTR_TRACKING_IMAGE",
    "database": "LMTR_DATABASE_IMAGE",
}
"""Variables that name the image of each role."""

KEPT = (
    "COMPOSE_PROJECT_NAME",
    "COMPOSE_PROFILES",
    "LMTR_UID",
    "LMTR_WORKER_CPUS",
    "LMTR_WORKER_CPU_LIMIT",
    "LMTR_CLUSTER_HOME",
    "LMTR_SECRETS",
)
"""What a start by hand must know to mean the same cluster."""

BUILD_ARGUMENTS = ("BASE_IMAGE", "TORCH_INDEX")
"""What may be set in the environment for a machine that reaches no registry or index."""


def main() -> int:
    """Do what the arguments say; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("action", choices=("up", "down", "images", "config"))
    parser.add_argument("--workers", type=int, default=2, help="containers that solve [2]")
    parser.add_argument("--cpus", type=int, help="processors of each [all there are, divided]")
    parser.add_argument("--storage", action="store_true", help="the lake in object storage")
    arguments = parser.parse_args()
    try:
        cluster = LocalCluster(arguments.workers, arguments.cpus, arguments.storage)
        getattr(cluster, arguments.action)()
    except (ToolError, ValueError, OSError) as error:
        print(f"cluster: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


class LocalCluster:
    """The containers that compose.yaml describes.

    Args:
        workers: Containers that solve.
        cpus: Processors of each; all of the machine, divided, by default.
        storage: Keep the lake in object storage of the cluster's own.
    """

    def __init__(self, workers: int, cpus: int | None, storage: bool) -> None:
        if workers < 1 or (cpus is not None and cpus < 1):
            raise ValueError("a cluster needs at least one worker with one processor")
        self._docker = docker_client()
        self._workers = workers
        self._cpus = cpus
        own, kept = compose_settings.read(DOTENV)
        # Whoever has a lake in object storage, or other files of Compose, goes on with them.
        self._storage = storage or "storage" in kept.get("COMPOSE_PROFILES", "")
        self._settings = {**self._defaults(), **_only(kept, "COMPOSE_FILE"), **own, **os.environ}
        named = Path(self._settings.get("LMTR_SECRETS") or "secrets")
        self._secrets = HERE / named  # as Compose takes a relative one
        self._settings["LMTR_SECRETS"] = str(self._secrets)

    def up(self) -> None:
        """Start it and wait until all of it is healthy; says what to do next."""
        engine = find_engine(self._docker)
        if engine.leaks_loopback:
            print(
                f"cluster: note: Docker Engine {engine.version} lets neighbours on a network "
                f"segment reach ports published on 127.0.0.1; update it to {CLOSED_LOOPBACK}, or "
                "close them in a firewall"
            )
        self._settings = {**self._sized(engine), **self._settings}
        made = make_secrets(self._secrets, int(self._settings["LMTR_UID"]))
        if self._storage:
            use_storage(self._secrets)
        self._keep()
        self.images()
        began = time.monotonic()
        # Containers that run would keep a secret that was changed.
        anew = ["--force-recreate"] if made else []
        scale = f"worker={self._workers}"
        self._compose("up", "--detach", "--remove-orphans", *anew, "--scale", scale)
        self._await_health(began + PATIENCE_S)
        print(f"cluster: all healthy after {time.monotonic() - began:.0f} s")
        self._tell()

    def down(self) -> None:
        """Stop it: jobs finish what is under way and commit it; data stay in the volumes."""
        self._compose("down", "--remove-orphans")

    def images(self) -> None:
        """Build the images, unless they are of this very code."""
        revision = _revision()
        roles = [*ROLES, "database"] if "lmtr-database" in self._config() else list(ROLES)
        for role in roles:
            image = self._settings[IMAGES[role]]
            if revision.endswith(".dirty") or self._revision_of(image) != revision:
                self._build(role, image, revision)

    def config(self) -> None:
        """Check Compose's files."""
        self._compose("config", "--quiet")

    def _defaults(self) -> dict[str, str]:
        defaults = {"COMPOSE_PROJECT_NAME": PROJECT}
        defaults |= {variable: f"lmtr-{role}:{_version()}" for role, variable in IMAGES.items()}
        if self._storage:
            defaults |= {"COMPOSE_PROFILES": "storage", "LMTR_CLUSTER_HOME": "s3://lmtr/home"}
        return defaults

    def _sized(self, engine: Engine) -> dict[str, str]:
        """Who the containers are, and what each worker gets of the engine's processors."""
        each = self._cpus or max(1, engine.processors // self._workers)
        return {
            "LMTR_UID": str(container_user(rootless=engine.rootless)),
            "LMTR_WORKER_CPUS": str(each),
            # Half a processor for the node's own processes, as far as there is one.
            "LMTR_WORKER_CPU_LIMIT": str(min(each + 0.5, engine.processors)),
        }

    def _keep(self) -> None:
        """Write down what this cluster is, for starts by hand and for the next of ours."""
        kept = _only(self._settings, *KEPT)
        if "COMPOSE_FILE" in self._settings:
            separator = self._settings.get("COMPOSE_PATH_SEPARATOR", os.pathsep)
            kept["COMPOSE_FILE"] = separator.join(map(str, compose_files(self._settings)))
        compose_settings.keep(DOTENV, kept)

    def _compose(self, *words: str) -> None:
        run([*self._compose_command(), *words], self._settings)

    def _compose_command(self) -> list[str]:
        files = [part for file in compose_files(self._settings) for part in ("--file", str(file))]
        return [*compose_command(self._docker), "--project-directory", str(HERE), *files]

    def _config(self) -> str:
        return output([*self._compose_command(), "config"], self._settings)

    def _build(self, role: str, image: str, revision: str) -> None:
        print(f"cluster: building {image}", flush=True)
        arguments = {"VERSION": _version(), "COMMIT": revision}
        arguments |= {name: os.environ[name] for name in BUILD_ARGUMENTS if name in os.environ}
        command = [self._docker, "build", "--file", str(HERE / "Dockerfile"), "--target", role]
        command += [part for pair in arguments.items() for part in ("--build-arg", "=".join(pair))]
        if authority := os.environ.get("BUILD_CA"):
            command += ["--secret", f"id=ca,src={authority}"]
        run([*command, "--tag", image, str(ROOT)], {**os.environ, "DOCKER_BUILDKIT": "1"})

    def _revision_of(self, image: str) -> str | None:
        """The commit that an image was made of; None if there is no such image."""
        label = '{{index .Config.Labels "org.opencontainers.image.revision"}}'
        try:
            return output([self._docker, "image", "inspect", "--format", label, image]).strip()
        except ToolError:
            return None

    def _await_health(self, until: float) -> None:
        """Return when every container is healthy."""
        while unhealthy := list(self._unhealthy()):
            if time.monotonic() > until:
                raise ToolError(
                    f"not healthy after {PATIENCE_S:.0f} s: {', '.join(unhealthy)}; look at "
                    f"`{self._docker} logs {unhealthy[0].partition(' ')[0]}`"
                )
            time.sleep(0.5)

    def _unhealthy(self) -> Iterator[str]:
        ids = output([*self._compose_command(), "ps", "--quiet"], self._settings).split()
        told = "{{.Name}} {{.State.Status}} {{with .State.Health}}{{.Status}}{{else}}none{{end}}"
        for line in output([self._docker, "inspect", "--format", told, *ids]).splitlines():
            name, status, health = line.lstrip("/").split()
            if (status, health) not in HEALTHY:
                yield f"{name} ({status}, {health})"

    def _tell(self) -> None:
        """Write the user's profile and say what can be done now."""
        given = self._settings
        head = f"http://127.0.0.1:{given.get('LMTR_DASHBOARD_PORT', '8265')}"
        tracking = f"http://127.0.0.1:{given.get('LMTR_TRACKING_PORT', '5000')}"
        values = {
            "cluster": head,
            "token_file": str(self._secrets / "ray_token"),
            "tracking": tracking,
            "home": given.get("LMTR_CLUSTER_HOME", "/data/home"),
        }
        name = given["COMPOSE_PROJECT_NAME"]
        name = "local" if name == PROJECT else name
        default = write_profile(settings_file(), values, name)
        profile = "" if default else f"--profile {name} "
        print(
            f"cluster: profile `{name}` is in {settings_file()}\n"
            f"  lmtr {profile}submit run demo       the whole path, on the cluster\n"
            f"  lmtr {profile}status                nodes, jobs, rows so far\n"
            f"  lmtr {profile}doctor --cluster      whether all is well, and how to mend the rest\n"
            f"  {tracking}          experiments\n"
            f"  {head}          Ray's dashboard; its token: {self._secrets / 'ray_token'}\n"
            "  make cluster-down           stop it; data stay"
        )


def _only(settings: Mapping[str, str], *names: str) -> dict[str, str]:
    return {name: settings[name] for name in names if name in settings}


def _version() -> str:
    text = (ROOT / "lmtr" / "__init__.py").read_text(encoding="utf-8")
    found = re.search(r'^__version__ = "([^"]+)"', text, re.MULTILINE)
    assert found is not None, "lmtr/__init__.py has no version"
    return found[1]


def _revision() -> str:
    """The commit that is checked out, marked if there are changes; empty outside of a checkout."""
    git = ["git", "-C", str(ROOT)]
    try:
        commit = output([*git, "rev-parse", "--short=12", "HEAD"]).strip()
        changed = output([*git, "status", "--porcelain", "--untracked-files=no"]).strip()
    except (ToolError, OSError):
        return ""
    return f"{commit}.dirty" if changed else commit


if __name__ == "__main__":
    sys.exit(main())
