"""Hosts of a cluster on one machine, that can be powered off and cut off for real.

Each host is a network namespace with a process tree, a shared memory and a name of its own, joined
to the others by a bridge in a namespace that no host is in. All see the same files, which stands
for a disk that a cluster shares. Needs root and iproute2.

    with Hosts(3) as hosts:
        hosts.start()
        driver = hosts.popen(0, ["lmtr", "generate", "--set", f"cluster.address={hosts.address}"])
        hosts.power_off(1)
        hosts.partition(2)
"""

import os
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from services.cluster.ray_cluster import HEALTH

PORT = 6379

SETUP = 'mount -t tmpfs -o size=2g tmpfs /dev/shm && hostname "$0" && exec sleep infinity'

UP = "sleep"
"""What the first process of a host is called when the host is up."""

SUPERVISED = 'until [ -e "$0" ]; do "$@" || true; sleep 1; done'
"""Start Ray again whenever it ends, as a supervisor does, until a file says not to."""

PATIENCE_S = 240.0
"""A host that is not up after so long never will be. Ray gives a node 30 s to start, which a busy
machine may exceed; its supervisor then starts it again."""


@dataclass
class Host:
    """One host.

    Attributes:
        name: Its name, and that of its network namespace.
        port: Its port at the switch.
        ip: Its address.
        unshare: The process that holds its namespaces; it takes all others with it.
    """

    name: str
    port: str
    ip: str
    unshare: subprocess.Popen[bytes] | None = None

    @property
    def init(self) -> int:
        """Number of the first process in it, as seen from outside."""
        assert self.unshare is not None, f"{self.name} is powered off"
        children = Path(f"/proc/{self.unshare.pid}/task/{self.unshare.pid}/children")
        until = time.monotonic() + PATIENCE_S
        while time.monotonic() < until:
            for child in children.read_text().split():
                if Path(f"/proc/{child}/comm").read_text().strip() == UP:
                    return int(child)
            time.sleep(0.02)
        raise AssertionError(f"{self.name} did not come up")


class Hosts:
    """So many hosts, numbered from 0; what they are made of goes when the block ends.

    Attributes:
        address: Of the cluster that :meth:`start` starts.
        environment: What every process of the cluster must have in its environment.
    """

    def __init__(self, count: int) -> None:
        tag = f"lmtr{secrets.token_hex(2)}"
        self._switch = f"{tag}-switch"
        self._hosts = [Host(f"{tag}-{n}", f"p{n}", f"10.77.0.{n + 1}") for n in range(count)]
        # Ray's sockets lie in here, and the path of a socket may have 107 characters at most.
        self._folder = Path(tempfile.mkdtemp(prefix="lmtrh-", dir="/tmp"))
        self._leave = ExitStack()
        self.address = f"{self._hosts[0].ip}:{PORT}"
        self.environment = {
            **HEALTH,
            "RAY_USAGE_STATS_ENABLED": "0",
            "RAY_AUTH_MODE": "token",
            "RAY_AUTH_TOKEN": secrets.token_hex(32),
        }

    @staticmethod
    def obstacle() -> str:
        """Why there can be no hosts on this machine; empty if there can."""
        needed = [name for name in ("ip", "unshare", "nsenter") if shutil.which(name) is None]
        if needed:
            return f"{needed[0]} is not installed (iproute2, util-linux)"
        name = f"lmtr-try-{os.getpid()}"
        made = subprocess.run(
            ["ip", "netns", "add", name], capture_output=True, text=True, check=False
        )
        if made.returncode:
            return f"no network namespace can be made: {made.stderr.strip()}"
        _ip("netns", "delete", name)
        return ""

    def __enter__(self) -> Self:
        with ExitStack() as undo:
            undo.callback(shutil.rmtree, self._folder, ignore_errors=True)
            _ip("netns", "add", self._switch)
            undo.callback(_ip, "netns", "delete", self._switch)
            _ip("-n", self._switch, "link", "add", "bridge", "type", "bridge")
            _ip("-n", self._switch, "link", "set", "bridge", "up")
            for host in self._hosts:
                _ip("netns", "add", host.name)
                undo.callback(_ip, "netns", "delete", host.name)
                self._plug_in(host)
                undo.callback(self._end, host)
                self._boot(host)
            undo.callback(self._stop_supervisors)
            self._leave = undo.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._leave.close()

    def start(self, cpus: int = 1) -> None:
        """Start a Ray cluster: host 0 leads, each host offers so many processors."""
        for number, host in enumerate(self._hosts):
            self._start_ray(number, host, cpus)
            if number == 0:
                self._await_head()
        self._await_nodes(len(self._hosts))

    def run(self, number: int, command: Sequence[str], **options: Any) -> Any:
        """Run a command on a host to its end; options are those of :func:`subprocess.run`."""
        return subprocess.run(self.entered(number, command), check=False, **options)

    def entered(self, number: int, command: Sequence[str]) -> list[str]:
        """The command, made to run on a host, with the cluster's environment."""
        enter = ["nsenter", "--target", str(self._hosts[number].init)]
        spaces = ["--mount", "--pid", "--uts", "--ipc", "--net"]
        variables = [f"{name}={value}" for name, value in self.environment.items()]
        return [*enter, *spaces, "--", "env", *variables, *command]

    def power_off(self, number: int) -> None:
        """End everything on a host at once; nobody gets a word of it."""
        self.partition(number)
        self._end(self._hosts[number])

    def partition(self, number: int) -> None:
        """Pull the plug of a host out of the switch; what runs on it runs on."""
        _ip("-n", self._switch, "link", "set", self._hosts[number].port, "down")

    def heal(self, number: int) -> None:
        """Put the plug of a host back in."""
        _ip("-n", self._switch, "link", "set", self._hosts[number].port, "up")

    def count_alive(self) -> int:
        """How many hosts Ray counts, asked on host 0."""
        asked = (
            "import ray\n"
            f"ray.init(address={self.address!r}, logging_level='ERROR', log_to_driver=False)\n"
            "print(sum(node['Alive'] for node in ray.nodes()))\n"
        )
        done = self.run(0, [sys.executable, "-c", asked], capture_output=True, text=True)
        # Ray tells of hosts on the same stream, after the answer.
        return int(done.stdout.split()[0]) if done.returncode == 0 else 0

    def _plug_in(self, host: Host) -> None:
        veth = ("link", "add", host.port, "type", "veth", "peer", "name", "eth0")
        _ip("-n", self._switch, *veth, "netns", host.name)
        _ip("-n", self._switch, "link", "set", host.port, "master", "bridge", "up")
        _ip("-n", host.name, "link", "set", "lo", "up")
        _ip("-n", host.name, "addr", "add", f"{host.ip}/24", "dev", "eth0")
        _ip("-n", host.name, "link", "set", "eth0", "up")

    def _boot(self, host: Host) -> None:
        spaces = ["--mount", "--pid", "--uts", "--ipc", "--fork", "--kill-child", "--mount-proc"]
        host.unshare = subprocess.Popen(
            ["ip", "netns", "exec", host.name, "unshare", *spaces, "sh", "-c", SETUP, host.name],
            start_new_session=True,
        )

    def _end(self, host: Host) -> None:
        if host.unshare is not None:
            # unshare's child is the first process of the host: the kernel ends the rest with it.
            host.unshare.send_signal(signal.SIGKILL)
            host.unshare.wait()
            host.unshare = None

    def _start_ray(self, number: int, host: Host, cpus: int) -> None:
        role = [f"--address={self.address}"]
        if number == 0:
            role = ["--head", f"--port={PORT}", "--include-dashboard=false"]
        command = [
            str(Path(sys.executable).with_name("ray")),
            "start",
            "--block",
            *role,
            f"--node-ip-address={host.ip}",
            f"--num-cpus={cpus}",
            "--object-store-memory=150000000",
            "--disable-usage-stats",
        ]
        temporary = self._folder / f"h{number}"
        temporary.mkdir()
        supervised = ["sh", "-c", SUPERVISED, str(self._folder / "stop"), *command]
        started = self.entered(number, ["env", f"RAY_TMPDIR={temporary}", *supervised])
        with (self._folder / f"h{number}.log").open("wb") as log:
            subprocess.Popen(started, stdout=log, stderr=log)

    def _await_head(self) -> None:
        test = f"import socket; socket.create_connection(({self._hosts[0].ip!r}, {PORT}), 1.0)"
        until = time.monotonic() + PATIENCE_S
        while self.run(0, [sys.executable, "-c", test], capture_output=True).returncode:
            assert time.monotonic() < until, self._log(0)
            time.sleep(0.3)

    def _await_nodes(self, count: int) -> None:
        until = time.monotonic() + PATIENCE_S
        while self.count_alive() < count:
            assert time.monotonic() < until, self._log(count - 1)

    def _log(self, number: int) -> str:
        return (self._folder / f"h{number}.log").read_text(errors="replace")[-2000:]

    def _stop_supervisors(self) -> None:
        (self._folder / "stop").touch()


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True)
