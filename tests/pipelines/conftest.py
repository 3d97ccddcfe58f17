"""A small home that the real stages made, shared by the tests that look at one."""

import sys
from pathlib import Path

import pytest

from pipelines.cli import main

TINY = """
[dataset]
name = "tiny"
solutions = 6
seed = 5

[segmentation]
epochs_per_solution = 8

[training]
latent = [0, 2]

[training.optimizer]
epochs = 4

[evaluation]
rollouts = 2

[evaluation.rollout]
duration = 3.0

[cluster]
workers = 0
"""


@pytest.fixture(scope="session", autouse=True)
def machine_cache(tmp_path_factory):
    """A cache of the tests' own, also for the processes that they start."""
    folder = tmp_path_factory.mktemp("machine") / "cache"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LMTR_CACHE", str(folder))
        yield folder


@pytest.fixture(scope="session")
def tiny_config(tmp_path_factory):
    path = tmp_path_factory.mktemp("configuration") / "tiny.toml"
    path.write_text(TINY)
    return path


@pytest.fixture
def lmtr(monkeypatch, capsys):
    """The command line: returns exit status, standard output and standard error of a call."""

    def call(*arguments: object) -> tuple[int, str, str]:
        capsys.readouterr()
        status = run_main(monkeypatch, *arguments)
        out, err = capsys.readouterr()
        return status, out, err

    return call


def run_main(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", ["lmtr", *map(str, arguments)])
    try:
        main()
    except SystemExit as stop:
        return int(stop.code or 0)
    return 0


@pytest.fixture(scope="session")
def tiny_home(tmp_path_factory, tiny_config) -> Path:
    """A home in which ``lmtr run`` has run once."""
    home = tmp_path_factory.mktemp("homes") / "tiny"
    with pytest.MonkeyPatch.context() as patch:
        assert run_main(patch, "--home", home, "run", tiny_config) == 0
    return home


@pytest.fixture(scope="session")
def cut_home(tmp_path_factory, tiny_config) -> Path:
    """A home in which the first two stages have run; copy it to change it."""
    home = tmp_path_factory.mktemp("homes") / "cut"
    with pytest.MonkeyPatch.context() as patch:
        for stage in ("generate", "segment"):
            assert run_main(patch, "--home", home, stage, "-c", tiny_config) == 0
    return home
