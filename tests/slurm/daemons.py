"""SLURM's daemons for some nodes on one machine, in a folder of their own.

Nothing of a SLURM that the machine may have is read or touched, and root is not needed. All nodes
are this machine: they have addresses, ports and spool folders of their own, and see the same disk.

    with Slurm(folder, nodes=3) as slurm:
        job = slurm.submit("job.sbatch", "word")
        slurm.await_end(job)
"""

import getpass
import os
import secrets
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Self

import psutil
from web import free_ports

from benchmarks.processes import end_all, left_over

PATIENCE_S = 60.0
"""Daemons that do not answer after so long never will."""

ENDING_S = 20.0

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch")

CONFIGURATION = """
ClusterName=lmtr
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={port}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket,cred_expire=10
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool-%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
SlurmdTimeout=20
ReturnToService=2
PartitionName=all Nodes=ALL Default=YES
"""
"""A requeued job waits until its old credential cannot be used any more, two minutes by default."""

NODE = "NodeName={name} NodeHostname={host} NodeAddr={address} Port={port} CPUs={cpus}\n"


class Slurm:
    """A controller and so many nodes that run inside a ``with`` statement.

    Args:
        folder: Where jobs are submitted, which stands for the disk that the nodes share.
        nodes: How many.
        cpus: Processors that each claims to have.
    """

    def __init__(self, folder: Path, nodes: int, cpus: int = 1) -> None:
        self.folder = folder
        self.names = [f"n{number + 1}" for number in range(nodes)]
        self._cpus = cpus
        # Sockets lie in here, and the path of one may have 107 characters at most. Munge wants no
        # folder above it that others could write to, but for /tmp itself.
        self._own = Path(tempfile.mkdtemp(prefix="slurm-", dir="/tmp"))
        self._daemons: dict[str, subprocess.Popen[bytes]] = {}
        self._environment = {
            **{name: text for name, text in os.environ.items() if not name.startswith("SLURM")},
            "SLURM_CONF": str(self._own / "slurm.conf"),
        }

    @staticmethod
    def obstacle() -> str:
        """Why there can be none on this machine; empty if there can."""
        missing = [name for name in PROGRAMS if _program(name) is None]
        if missing:
            return f"{missing[0]} is not installed (slurmctld, slurmd, slurm-client, munge)"
        return ""

    def __enter__(self) -> Self:
        try:
            self._configure()
            self._start_munge()
            self._start("slurmctld", "slurmctld", "-D")
            for name in self.names:
                (self._own / f"spool-{name}").mkdir()
                self._start(name, "slurmd", "-D", "-N", name)
            self._await_nodes()
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def submit(self, *words: object, environment: Mapping[str, str] | None = None) -> str:
        """Number of the job that ``sbatch`` makes of these words."""
        done = self.run("sbatch", "--parsable", *words, environment=environment)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    def run(
        self, program: str, *words: object, environment: Mapping[str, str] | None = None
    ) -> subprocess.CompletedProcess[str]:
        """A program of SLURM, run to its end in the shared folder."""
        return subprocess.run(
            [_program(program) or program, *map(str, words)],
            cwd=self.folder,
            env={**self._environment, **(environment or {})},
            capture_output=True,
            text=True,
            check=False,
        )

    def job(self, number: str) -> dict[str, str]:
        """What the controller says of a job."""
        said = self.run("scontrol", "show", "job", "--oneliner", number).stdout
        return dict(word.split("=", 1) for word in said.split() if "=" in word)

    def await_state(self, number: str, *states: str, patience_s: float) -> dict[str, str]:
        """What is said of the job once it is in one of these states."""
        until = time.monotonic() + patience_s
        while (job := self.job(number)).get("JobState") not in states:
            assert time.monotonic() < until, f"{job}\n{self._told('slurmctld')}"
            time.sleep(0.2)
        return job

    def power_off(self, name: str) -> None:
        """End a node at once, with all that runs on it; the controller gets no word of it."""
        self._daemons.pop(name).kill()
        end_all(self.members(f"SLURMD_NODENAME={name}"))

    def members(self, variable: str = "") -> list[psutil.Process]:
        """Processes of these daemons and their jobs, by a variable that they have besides."""
        mine = f"SLURM_CONF={self._environment['SLURM_CONF']}"
        found = []
        for process in psutil.process_iter():
            with suppress(OSError):
                words = Path(f"/proc/{process.pid}/environ").read_text(errors="replace").split("\0")
                if mine in words and (not variable or variable in words):
                    found.append(process)
        return found

    def _configure(self) -> None:
        host = socket.gethostname().partition(".")[0]
        ports = free_ports(len(self.names) + 1)
        text = CONFIGURATION.format(
            host=host, port=ports[0], user=getpass.getuser(), folder=self._own
        )
        for number, name in enumerate(self.names):
            text += NODE.format(
                name=name,
                host=host,
                address=f"127.0.0.{number + 1}",
                port=ports[number + 1],
                cpus=self._cpus,
            )
        (self._own / "slurm.conf").write_text(text)
        (self._own / "state").mkdir()

    def _start_munge(self) -> None:
        key = self._own / "munge.key"
        key.touch(mode=0o600)
        key.write_bytes(secrets.token_bytes(128))
        files = {
            "socket": self._own / "munge.socket",
            "key-file": key,
            "pid-file": self._own / "munge.pid",
            "seed-file": self._own / "munge.seed",
            "log-file": self._own / "munge.log",
        }
        options = [f"--{name}={file}" for name, file in files.items()]
        self._start("munged", "munged", "--foreground", "--force", *options)
        until = time.monotonic() + PATIENCE_S
        while not files["socket"].exists():
            assert self._daemons["munged"].poll() is None, self._told("munged")
            assert time.monotonic() < until, self._told("munged")
            time.sleep(0.05)

    def _start(self, name: str, program: str, *options: str) -> None:
        with (self._own / f"{name}.out").open("wb") as log:
            self._daemons[name] = subprocess.Popen(
                [_program(program) or program, *options],
                cwd=self._own,
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def _await_nodes(self) -> None:
        until = time.monotonic() + PATIENCE_S
        while (
            self.run("sinfo", "--noheader", "--format=%T %D").stdout != f"idle {len(self.names)}\n"
        ):
            assert time.monotonic() < until, "\n".join(map(self._told, self._daemons))
            time.sleep(0.2)

    def _told(self, name: str) -> str:
        files = [self._own / f"{name}.out", self._own / f"{name}.log"]
        texts = [file.read_text(errors="replace")[-2000:] for file in files if file.exists()]
        return "\n".join([name, *texts])

    def _end(self) -> None:
        """Jobs first: those that know how to end clean up behind them."""
        self.run("scancel", "--user", getpass.getuser())
        until = time.monotonic() + ENDING_S
        while self.run("squeue", "--noheader").stdout.strip() and time.monotonic() < until:
            time.sleep(0.2)
        end_all(self.members())
        for daemon in self._daemons.values():
            daemon.wait()
        left = left_over(self.members(), ENDING_S)
        shutil.rmtree(self._own, ignore_errors=True)
        assert left == [], left


def _program(name: str) -> str | None:
    """Where a program is; daemons are not on every user's path."""
    return shutil.which(name, path=f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin")
