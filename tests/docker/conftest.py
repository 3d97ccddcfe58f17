"""One cluster of containers for all tests that want one, and a table of what befell it."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest

from tests.docker import engine
from tests.docker.containers import Containers

SOLUTIONS = 160
"""Half a minute of work on a quiet machine of two cores, a minute on a busy one."""

UNDER_WAY = 5
"""Commits, each of a row at least, after which a generation is under way."""

ROLLOUTS = 4
MODELS = {"unimodal", "LMTR-2"}

CONFIGURATION = f"""
[dataset]
name = "containers"
solutions = {SOLUTIONS}
seed = 11

[segmentation]
epochs_per_solution = 8

[training]
latent = [0, 2]

[training.optimizer]
epochs = 60

[evaluation]
rollouts = {ROLLOUTS}

[evaluation.rollout]
duration = 3.0

[cluster]
address = "auto"
commit_items = 8
commit_seconds = 1.0
"""
"""The expert as it is, so that a data set takes a while, and small commits."""


@dataclass
class Faults:
    """What befell the cluster, for the table at the end."""

    lines: list[tuple[str, ...]] = field(default_factory=list)

    HEAD = ("fault", "what the user saw", "seconds to recover", "rows lost", "rows doubled")

    def add(self, fault: str, seen: str, seconds: float, lost: int, doubled: int) -> None:
        """One line."""
        self.lines.append((fault, seen, f"{seconds:.1f}", str(lost), str(doubled)))

    def __str__(self) -> str:
        rows = [self.HEAD, *self.lines]
        widths = [max(len(row[n]) for row in rows) for n in range(len(self.HEAD))]
        return "\n".join(
            " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
            for row in rows
        )


@pytest.fixture(scope="session")
def containers(tmp_path_factory) -> Iterator[Containers]:
    """The cluster."""
    if obstacle := engine.obstacle():
        pytest.skip(obstacle)
    with engine.engine() as docker:
        engine.require_base(docker)
        with Containers(tmp_path_factory.mktemp("containers")) as cluster:
            write = "cat > /data/config.toml"
            cluster.inside("head", "sh", "-c", f"{write} <<'E'\n{CONFIGURATION}\nE")
            yield cluster


@pytest.fixture(scope="session")
def reference(containers) -> list[tuple[int, str]]:
    """The data set as it is without faults: index and digest of each row."""
    job = containers.finish(containers.submit(command("generate", "/data/reference")))
    assert job.status == "SUCCEEDED", containers.log(job.id)[-3000:]
    rows = containers.rows("/data/reference")
    assert [index for index, _ in rows] == list(range(SOLUTIONS))
    return rows


@pytest.fixture(scope="session")
def faults(request) -> Iterator[Faults]:
    """The table, printed at the end."""
    table = Faults()
    yield table
    capture = request.config.pluginmanager.getplugin("capturemanager")
    with capture.global_and_fixture_disabled():
        print(f"\n{table}")


def command(stage: str, home: str, *options: str) -> str:
    """A stage's command on the cluster."""
    return " ".join(["lmtr", "--home", home, stage, "-c", "/data/config.toml", *options])
