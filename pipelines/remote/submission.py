"""A stage as a job: checked here, then sent to the cluster with its configuration."""

import getpass
import re
import shlex
import socket
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lmtr import __version__
from pipelines.config import source_text
from pipelines.progress import say
from pipelines.provenance import code_version
from pipelines.remote.target import Target
from pipelines.remote.versions import (
    Versions,
    cluster_versions,
    differences,
    remarks,
    require_same,
)
from services.errors import ClusterError, JobExistsError

STAGE = "lmtr.stage"
CONFIGURATION = "lmtr.configuration"
DATASET = "lmtr.dataset"
COMMAND = "lmtr.command"

ALIKE = 10
"""So many jobs of one second can be told apart."""


@dataclass(frozen=True)
class Submission:
    """What is to be done on the cluster.

    Attributes:
        stage: The command, ``generate`` for example.
        words: Its options as typed, without configuration, home, and what is about submitting.
        config: Built-in name or path of the configuration; None for all defaults.
        config_option: The option that takes it; empty where it is the argument.
        dataset_id: The data set that it is about; empty if that is decided on the cluster.
        command: What the user typed, to be repeated.
    """

    stage: str
    words: tuple[str, ...]
    config: str | None
    config_option: str
    dataset_id: str
    command: str

    @property
    def name(self) -> str:
        """The configuration's."""
        return "default" if self.config is None else Path(self.config).stem

    @property
    def file(self) -> str:
        """Name of the configuration's file on the cluster; a study is called by it."""
        return f"{self.name}.toml"

    def files(self) -> dict[str, str]:
        """What travels with the job."""
        return {} if self.config is None else {self.file: source_text(self.config)}

    def entrypoint(self, home: str | None) -> str:
        """The ordinary command, for the head's shell."""
        before = [] if home is None else ["--home", home]
        named = [] if self.config is None else [self.config_option, self.file]
        return shlex.join(
            [
                *("lmtr", *before, self.stage),
                *(word for word in named if word),
                *self.words,
                *("--set", "cluster.address=auto"),
            ]
        )

    def metadata(self) -> dict[str, str]:
        """What is noted on the job."""
        noted = {
            STAGE: self.stage,
            CONFIGURATION: self.name,
            DATASET: self.dataset_id,
            COMMAND: self.command,
            "lmtr.version": __version__,
            "lmtr.code": code_version(),
            "lmtr.by": f"{getpass.getuser()}@{socket.gethostname()}",
        }
        return {key: value for key, value in noted.items() if value}


def submit(submission: Submission, target: Target, *, any_version: bool = False) -> str:
    """Send it, if the cluster has our versions; returns the job's id.

    Args:
        submission: What is to be done; its configuration was checked.
        target: The cluster.
        any_version: Send it to a cluster with other versions too.

    Raises:
        ClusterError: The cluster does not answer, refuses us, has other versions, or no home.
    """
    _require_versions(target, any_version)
    job_id = _send(submission, target)
    about = submission.dataset_id and f", data set {submission.dataset_id}"
    say(f"submitted {job_id} to {target.url}{about}")
    say(f"  follow: {target.command('logs', job_id, '-f')}")
    say(f"  stop:   {target.command('cancel', job_id)}  (what is under way is finished and kept)")
    say(f"  all:    {target.command('jobs')}")
    say("If the cluster's head dies, the same command goes on with what is committed.")
    return job_id


def job_name(stage: str, name: str) -> str:
    """A job's id for people: stage, configuration and local time."""
    plain = re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-")[:40] or "configuration"
    return f"{stage}-{plain}-{time.strftime('%Y%m%d-%H%M%S')}"


def _require_versions(target: Target, any_version: bool) -> None:
    ours = Versions.here()
    ray_version = target.jobs.ray_version()
    if ray_version != ours.ray and not any_version:
        # A Ray of another version may not even begin the job that tells the rest.
        theirs = ours.model_copy(update={"ray": ray_version})
        require_same(ours, theirs, target.url)
    theirs = cluster_versions(target)
    if differences(ours, theirs) or (target.home is None and not theirs.home):
        theirs = cluster_versions(target, anew=True)
    try:
        require_same(ours, theirs, target.url)
    except ClusterError as error:
        if not any_version:
            raise
        say(f"warning: {error}")
    for remark in remarks(ours, theirs):
        say(f"note: the cluster has {remark}")
    if target.home is None and not theirs.home:
        raise ClusterError(
            f"cluster {target.url}: no home is named and its machines have no LMTR_HOME; give "
            "--home as they see it, or `home` in the profile"
        )


def _send(submission: Submission, target: Target) -> str:
    base = job_name(submission.stage, submission.name)
    names = [base, *(f"{base}-{number}" for number in range(2, ALIKE + 1))]
    for job_id in names:
        try:
            target.jobs.submit(
                job_id,
                submission.entrypoint(target.home),
                submission.metadata(),
                submission.files(),
            )
        except JobExistsError:
            continue
        return job_id
    raise ClusterError(
        f"cluster {target.url}: it has {ALIKE} jobs called {base!r} already; submit again "
        "in a second"
    )


def shown(words: Sequence[str]) -> str:
    """A command as it was typed."""
    return shlex.join(["lmtr", *words])
