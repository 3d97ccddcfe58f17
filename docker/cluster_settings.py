"""What a cluster of containers is: from what was typed, the environment, and ``.env``.

In this order. What was once set is kept in ``.env``, but for what is computed anew each time.
"""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import compose_settings
from compose_client import COMPOSE_FILE, HERE, Engine

PROJECT = "lmtr"
PROFILE = "local"
STORAGE_PROFILE = "storage"
HOMES = {False: "/data/home", True: "s3://lmtr/home"}
"""The home in the volume, and in the cluster's own object storage."""

WORKERS = 2
CPU_SHARE = 0.5
"""Processors for a node's own processes, beside those that it offers."""

NODE_MB, SOLVER_MB, LEAST_MB = 1024, 384, 3072
"""Memory of a worker: its own processes, each solver's, and the least that one gets (MiB)."""

COMPUTED = frozenset(
    {"LMTR_WORKER_CPUS", "LMTR_WORKER_CPU_LIMIT", "LMTR_WORKER_MEMORY", "LMTR_SECRETS_STATE"}
)
"""What follows from the rest, unless the environment or a line of the user's says it."""


@dataclass(frozen=True)
class Wishes:
    """What was typed; None is what was not.

    Attributes:
        name: Of the cluster.
        workers: Containers that solve.
        cpus: Processors of each.
        storage: Whether the lake is in object storage of the cluster's own.

    Raises:
        ValueError: The name is none.
    """

    name: str | None = None
    workers: int | None = None
    cpus: int | None = None
    storage: bool | None = None

    def __post_init__(self) -> None:
        if self.name is not None and not re.fullmatch(r"[a-z0-9][a-z0-9_-]*", self.name):
            raise ValueError(f"{self.name!r} is no name: small letters, digits, - and _")


class ClusterSettings:
    """Settings of one cluster.

    Args:
        wishes: What was typed.

    Attributes:
        project: Compose's name for it.
        dotenv: The file that settings are kept in; ``LMTR_DOTENV`` names another one.
        said: Settings that were typed, in the environment, or in the user's lines.
        values: All settings, also those of earlier starts, by their variables.
        environment: Of Compose, which reads the rest in ``dotenv`` itself.

    Raises:
        ValueError: There would be nothing that solves.
    """

    def __init__(self, wishes: Wishes) -> None:
        self._wishes = wishes
        environ = dict(os.environ)
        named = compose_settings.Dotenv.of(HERE / ".env").own.get("COMPOSE_PROJECT_NAME")
        usual = named or PROJECT
        self.project = wishes.name or environ.get("COMPOSE_PROJECT_NAME") or usual
        self.is_usual = self.project == usual
        file = HERE / (".env" if self.is_usual else f".env.{self.project}")
        self.dotenv = Path(environ.get("LMTR_DOTENV") or file)
        said = compose_settings.Dotenv.of(self.dotenv)
        self._own = said.own
        typed = self._typed()
        self.said = {**said.own, **environ, **typed}
        self.values = {**_meant(said.kept), **self.said}
        if not (self.is_usual or self.values.get("LMTR_SECRETS")):
            self.values["LMTR_SECRETS"] = f"./secrets-{self.project}"
        self.values["LMTR_CLUSTER_HOME"] = (
            self.values.get("LMTR_CLUSTER_HOME") or HOMES[_has_storage(self.values)]
        )
        _check_sizes(self.values)
        self.environment = {**environ, **typed}

    @property
    def has_storage(self) -> bool:
        """Whether object storage is among the containers."""
        return _has_storage(self.values)

    @property
    def drops_storage(self) -> bool:
        """Whether what was typed wants it no longer."""
        return self._wishes.storage is False

    @property
    def secrets(self) -> Path:
        """Folder of the secrets; a relative one is taken as Compose does."""
        return HERE / (self.values.get("LMTR_SECRETS") or "secrets")

    @property
    def files(self) -> list[Path]:
        """Compose's files: those that ``COMPOSE_FILE`` names, else ours."""
        separator = self.values.get("COMPOSE_PATH_SEPARATOR") or os.pathsep
        named = [name for name in self.values.get("COMPOSE_FILE", "").split(separator) if name]
        return [Path(name).absolute() for name in named] or [COMPOSE_FILE]

    @property
    def bind(self) -> str:
        """Address of this machine that its ports are published on."""
        return self.values.get("LMTR_BIND") or "127.0.0.1"

    @property
    def head(self) -> str:
        """Address of the head on this machine."""
        return f"http://127.0.0.1:{self.values.get('LMTR_DASHBOARD_PORT') or 8265}"

    @property
    def tracking(self) -> str:
        """Address of the tracking server on this machine."""
        return f"http://127.0.0.1:{self.values.get('LMTR_TRACKING_PORT') or 5000}"

    @property
    def home(self) -> str:
        """The home as nodes see it."""
        return self.values["LMTR_CLUSTER_HOME"]

    @property
    def profile(self) -> str:
        """Name in the user's settings file."""
        return PROFILE if self.project == PROJECT else self.project

    def keep(self, engine: Engine, **found: str) -> None:
        """Write down what this cluster is, for starts by hand and for the next of ours.

        Raises:
            ValueError: A value cannot be written.
        """
        self.values = {**self._shares(engine), **self.values, **found}
        names = {"COMPOSE_PROJECT_NAME", "COMPOSE_PROFILES"}
        for file in self.files:
            names |= set(re.findall(r"\$\{(LMTR_\w+)", file.read_text(encoding="utf-8")))
        meant = {name: self.values[name] for name in names if name in self.values}
        self.environment |= meant
        if self.values.get("COMPOSE_FILE"):
            meant["COMPOSE_FILE"] = os.pathsep.join(map(str, self.files))
        kept = {name: value for name, value in meant.items() if name not in self._own}
        compose_settings.keep(self.dotenv, kept)

    def _typed(self) -> dict[str, str]:
        wishes = self._wishes
        typed = {"COMPOSE_PROJECT_NAME": self.project}
        if wishes.workers is not None:
            typed["LMTR_WORKERS"] = str(wishes.workers)
        if wishes.cpus is not None:
            typed["LMTR_WORKER_CPUS"] = str(wishes.cpus)
        if wishes.storage is not None:
            typed["COMPOSE_PROFILES"] = STORAGE_PROFILE if wishes.storage else ""
        return typed

    def _shares(self, engine: Engine) -> dict[str, str]:
        """What each worker gets of the engine's processors, and of memory."""
        workers = int(self.values.get("LMTR_WORKERS") or WORKERS)
        each = int(self.values.get("LMTR_WORKER_CPUS") or max(1, engine.processors // workers))
        limit = min(each + CPU_SHARE, engine.processors) if engine.shares_processors else 0
        return {
            "LMTR_WORKER_CPUS": str(each),
            "LMTR_WORKER_CPU_LIMIT": str(limit),
            "LMTR_WORKER_MEMORY": f"{max(LEAST_MB, NODE_MB + each * SOLVER_MB)}m",
        }


def _check_sizes(settings: Mapping[str, str]) -> None:
    for name in ("LMTR_WORKERS", "LMTR_WORKER_CPUS"):
        if not re.fullmatch(r"[1-9]\d*|", settings.get(name, "")):
            raise ValueError(
                f"{name}={settings[name]}: a cluster needs at least one worker with one processor"
            )


def _has_storage(settings: Mapping[str, str]) -> bool:
    return STORAGE_PROFILE in settings.get("COMPOSE_PROFILES", "").split(",")


def _meant(kept: Mapping[str, str]) -> dict[str, str]:
    """What of an earlier start was set, and did not follow from the rest."""
    followed = {"LMTR_CLUSTER_HOME": HOMES[_has_storage(kept)]}
    return {
        name: value
        for name, value in kept.items()
        if name not in COMPUTED and followed.get(name) != value
    }
