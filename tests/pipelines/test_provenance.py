"""Which code rows are said to come of, where there is a checkout and where there is none."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lmtr import __version__

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def installed(tmp_path):
    """What the version is told by, outside of a checkout; asks it in a process of its own."""
    (tmp_path / "pipelines").mkdir()
    (tmp_path / "lmtr").mkdir()
    for part in ("pipelines/__init__.py", "pipelines/provenance.py", "lmtr/__init__.py"):
        shutil.copy(ROOT / part, tmp_path / part)

    def ask() -> str:
        told = "from pipelines.provenance import code_version; print(code_version())"
        command = [sys.executable, "-c", told]
        environment = {"PYTHONPATH": str(tmp_path)}
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
        )
        return done.stdout.strip()

    return tmp_path, ask


def test_without_a_checkout_the_version_is_all_there_is(installed):
    _, ask = installed
    assert ask() == __version__


def test_an_image_has_its_commit_in_a_file(installed):
    folder, ask = installed
    (folder / "pipelines" / "commit").write_text("0123456789ab.dirty\n")
    assert ask() == f"{__version__}+0123456789ab.dirty"
