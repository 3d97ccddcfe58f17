"""Start and stop the cluster of containers on this machine: `make cluster`, `make cluster-down`.

python docker/cluster.py up|down|images|config

The standard library alone, so that it runs before anything is installed.
"""

import argparse
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from cluster_settings import STORAGE_PROFILE, ClusterSettings, Wishes
from compose_client import (
    CLOSED_LOOPBACK,
    HERE,
    ToolError,
    compose_command,
    docker_client,
    find_engine,
    output,
    run,
)
from images import image_of, require_image
from preparation import IMAGE_USER, container_user, make_secrets, secrets_state, use_storage
from user_profile import settings_file, write_profile

PATIENCE_S = 300.0
"""How long containers may take until they are healthy."""

HEALTHY = (("running", "healthy"), ("exited", "none"))
"""Statuses and health of containers that do their part, or had one to do and have done it."""

ROLES = ("node", "tracking")

SET_PASSWORD = """
printf "ALTER ROLE lmtr PASSWORD '%s'" "$(cat /run/secrets/postgres_password)" |
    psql --quiet --host=/var/run/postgresql --username=lmtr --dbname=mlflow
"""
"""Run in the database's container, so that the password is in no argument of a process."""


def main() -> int:
    """Do what the arguments say; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("action", choices=("up", "down", "images", "config"))
    parser.add_argument("--name", help="name of the cluster, if there are several [lmtr]")
    parser.add_argument("--workers", type=int, help="containers that solve [as before, or 2]")
    parser.add_argument("--cpus", type=int, help="processors of each [all there are, divided]")
    parser.add_argument(
        "--storage",
        action=argparse.BooleanOptionalAction,
        help="the lake in object storage [as before, or not]",
    )
    asked = parser.parse_args()
    try:
        wishes = Wishes(asked.name, asked.workers, asked.cpus, asked.storage)
        getattr(LocalCluster(ClusterSettings(wishes)), asked.action)()
    except (ToolError, ValueError, OSError) as error:
        print(f"cluster: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


class LocalCluster:
    """The containers that compose.yaml describes.

    Args:
        settings: Which, and how large.
    """

    def __init__(self, settings: ClusterSettings) -> None:
        self._docker = docker_client()
        self._settings = settings

    def up(self) -> None:
        """Start it and wait until all of it is healthy; says what to do next."""
        engine = find_engine(self._docker)
        if engine.leaks_loopback:
            print(
                f"cluster: note: Docker Engine {engine.version} lets neighbours on a network "
                f"segment reach ports published on 127.0.0.1; update it to {CLOSED_LOOPBACK}, or "
                "close them in a firewall"
            )
        if (bind := self._settings.bind) != "127.0.0.1":
            print(f"cluster: note: others may reach it at {bind}, MLflow without a password")
        self._refuse_another_checkout()
        self.images()
        user = self._require_secrets()
        use_storage(self._settings.secrets, self._settings.has_storage)
        state = secrets_state(self._settings.secrets)
        self._settings.keep(engine, LMTR_UID=str(user), LMTR_SECRETS_STATE=state)
        self._start()

    def down(self) -> None:
        """Stop it: jobs finish what is under way and commit it; data stay in the volumes."""
        self._refuse_another_checkout()
        self._drain()
        self._compose("--profile", STORAGE_PROFILE, "down", "--remove-orphans")

    def images(self) -> None:
        """Build the images, unless they are of this very code."""
        names = self._settings.values
        roles = [*ROLES, "database"] if image_of("database", names) in self._config() else ROLES
        for role in roles:
            require_image(self._docker, role, names)

    def config(self) -> None:
        """Check Compose's files."""
        self._compose("config", "--quiet")

    def _start(self) -> None:
        began = time.monotonic()
        if self._settings.drops_storage:
            self._drain()
            self._compose("--profile", STORAGE_PROFILE, "rm", "--stop", "--force", "storage")
        self._compose("up", "--detach", "--remove-orphans")
        # The volume may be older than the password, and the tracking server waits for it.
        self._await_health(began + PATIENCE_S, "database")
        database = self._containers("database")[0]
        run([self._docker, "exec", database, "sh", "-c", SET_PASSWORD])
        self._await_health(began + PATIENCE_S)
        print(f"cluster: all healthy after {time.monotonic() - began:.0f} s")
        self._tell()

    def _drain(self) -> None:
        """Let jobs commit while all that they need is still there."""
        self._compose("stop", "head")

    def _require_secrets(self) -> int:
        """Make secrets that are missing; returns the number of a user who reads them in containers.

        Raises:
            ToolError: There is none.
        """
        folder, said = self._settings.secrets, self._settings.said.get("LMTR_UID")
        usual = int(self._settings.values.get("LMTR_UID") or container_user())
        # Where an engine maps users, its containers' group is that of whoever starts them.
        for user, mode in ((usual, 0o600), (usual if said else IMAGE_USER, 0o640)):
            make_secrets(folder, user, mode)
            try:
                self._read(user, folder / "ray_token")
            except ToolError as error:
                reason = error
            else:
                return user
        raise ToolError(
            f"containers cannot read {folder} as user {user} ({reason}); if LMTR_UID is set, "
            f"remove it; if this machine has SELinux, `chcon -R -t container_file_t {folder}` "
            "allows it; if the engine maps users (userns-remap), use one that does not, or a "
            "rootless one"
        )

    def _read(self, user: int, file: Path) -> None:
        mount = f"type=bind,source={file},target=/asked,readonly"
        command = [self._docker, "run", "--rm", "--network", "none", "--user", f"{user}:0"]
        command += ["--cap-drop", "ALL", "--mount", mount]
        image = image_of("node", self._settings.values)
        output([*command, "--entrypoint", "test", image, "-r", "/asked"])

    def _refuse_another_checkout(self) -> None:
        """Two checkouts would take each other's cluster of the same name for their own."""
        label = "com.docker.compose.project"
        project = self._settings.project
        command = [self._docker, "ps", "--all", "--filter", f"label={label}={project}"]
        told = output([*command, "--format", f'{{{{.Label "{label}.working_dir"}}}}'])
        others = {Path(folder).resolve() for folder in told.splitlines() if folder} - {HERE}
        for folder in filter(Path.exists, others):
            raise ToolError(
                f"there is a cluster {project!r} that {folder} has started; remove it from there "
                "(make cluster-down), or give this one another name: make cluster NAME=…, and "
                "other ports"
            )

    def _compose(self, *words: str) -> None:
        run([*self._compose_command(), *words], self._settings.environment)

    def _compose_command(self) -> list[str]:
        command = [*compose_command(self._docker), "--project-directory", str(HERE)]
        if self._settings.dotenv.exists():
            command += ["--env-file", str(self._settings.dotenv)]
        files = self._settings.files
        return [*command, *(part for file in files for part in ("--file", str(file)))]

    def _config(self) -> str:
        return output([*self._compose_command(), "config"], self._settings.environment)

    def _containers(self, service: str = "") -> list[str]:
        """Ids of the containers, also of those that do not run."""
        label = "com.docker.compose"
        wanted = [f"label={label}.project={self._settings.project}", f"label={label}.oneoff=False"]
        wanted += [f"label={label}.service={service}"] if service else []
        filters = [part for each in wanted for part in ("--filter", each)]
        found = output([self._docker, "ps", "--all", "--quiet", *filters]).split()
        if not found:
            raise ToolError(f"there are no containers of {self._settings.project} {service}")
        return found

    def _await_health(self, until: float, service: str = "") -> None:
        """Return when every container is healthy, or those of a service."""
        while unhealthy := list(self._unhealthy(service)):
            if time.monotonic() > until:
                raise ToolError(
                    f"not healthy after {PATIENCE_S:.0f} s: {', '.join(unhealthy)}; look at "
                    f"`{self._docker} logs {unhealthy[0].partition(' ')[0]}`"
                )
            time.sleep(0.5)

    def _unhealthy(self, service: str) -> Iterator[str]:
        told = "{{.Name}} {{.State.Status}} {{with .State.Health}}{{.Status}}{{else}}none{{end}}"
        command = [self._docker, "inspect", "--format", told, *self._containers(service)]
        for line in output(command).splitlines():
            name, status, health = line.lstrip("/").split()
            if (status, health) not in HEALTHY:
                yield f"{name} ({status}, {health})"

    def _tell(self) -> None:
        """Write the user's profile and say what can be done now."""
        settings = self._settings
        token = settings.secrets / "ray_token"
        values = {
            "cluster": settings.head,
            "token_file": str(token),
            "tracking": settings.tracking,
            "home": settings.home,
        }
        file, name = settings_file(), settings.profile
        default = write_profile(file, values, name)
        if os.environ.get("SUDO_UID"):
            print(f"cluster: note: started by sudo, so {file} is root's; `lmtr` reads your own")
        profile = "" if default else f"--profile {name} "
        naming = "" if settings.is_usual else f" NAME={settings.project}"
        chosen = "" if settings.is_usual else f"--env-file {settings.dotenv.name} "
        print(
            f"cluster: profile `{name}` is in {file}\n"
            f"  lmtr {profile}submit run demo       the whole path, on the cluster\n"
            f"  lmtr {profile}status                nodes, jobs, rows so far\n"
            f"  lmtr {profile}doctor --cluster      whether all is well, and how to mend the rest\n"
            f"  {settings.tracking}          experiments\n"
            f"  {settings.head}          Ray's dashboard; its token: {token}\n"
            f"  make cluster-down{naming}           stop it; data stay\n"
            f"  cd docker && docker compose {chosen}ps   its containers"
        )


if __name__ == "__main__":
    sys.exit(main())
