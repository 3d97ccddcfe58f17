"""The script for SLURM, as far as it can be checked without one."""

import re
import shutil
import stat
import subprocess
from pathlib import Path

import pytest

from services.cluster.ray_cluster import HEALTH

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "clusters" / "slurm" / "lmtr.sbatch"
PAGE = ROOT / "docs" / "clusters-existing.md"

OTHERWISE = {"RAY_AUTH_TOKEN", "RAY_GRACEFUL_SHUTDOWN_DRAIN_TIMEOUT_S"}
"""Variables of the page's table that are not as there: of a token only the file is named, and hosts
that all end at once do not wait."""

pytestmark = pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")


@pytest.fixture
def text():
    return SCRIPT.read_text(encoding="utf-8")


@pytest.fixture
def bare(tmp_path):
    """Run the script with these variables alone, where there is neither LMTR nor Ray."""
    for name in ("bash", "dirname", "mkdir", "rm"):
        (tmp_path / name).symlink_to(shutil.which(name))

    def run(*words, **variables):
        environment = {"PATH": str(tmp_path), "SLURM_SUBMIT_DIR": str(tmp_path), **variables}
        command = ["bash", str(SCRIPT), *words]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)

    return run


def exported(text):
    return dict(re.findall(r"^export (\w+)=(\S+)$", text, re.MULTILINE))


def page_table():
    rows = re.findall(r"^\| `(RAY_\w+)` \| ([^|]+) \|", PAGE.read_text("utf-8"), re.MULTILINE)
    return {name: value.strip().strip("`") for name, value in rows}


def directives(text):
    return dict(re.findall(r"^#SBATCH --([\w-]+)(?:=(\S+))?$", text, re.MULTILINE))


def test_the_script_is_whole():
    done = subprocess.run(["bash", "-n", str(SCRIPT)], capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    assert stat.S_IMODE(SCRIPT.stat().st_mode) & 0o111


@pytest.mark.skipif(shutil.which("shellcheck") is None, reason="no shellcheck")
def test_shellcheck_finds_nothing():
    done = subprocess.run(["shellcheck", str(SCRIPT)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_every_process_has_the_variables_of_the_page(text):
    table = page_table()
    assert HEALTH.items() <= table.items()
    given = exported(text)
    assert given.pop("RAY_AUTH_TOKEN_PATH")
    assert given.pop("RAY_GRACEFUL_SHUTDOWN_DRAIN_TIMEOUT_S") == "0"
    assert given == {name: value for name, value in table.items() if name not in OTHERWISE}


def test_the_token_is_in_a_file_and_in_no_argument_or_variable(text):
    uses = [line for line in text.splitlines() if "token" in line.lower()]
    assert [line for line in uses if re.search(r"\b(ray|lmtr|srun|say|echo) ", line)] == []
    assert "unset RAY_AUTH_TOKEN " in text
    assert exported(text)["RAY_AUTH_TOKEN_PATH"] == "$folder/token"


def test_the_job_may_be_queued_again_and_is_told_before_its_time_is_up(text):
    asked = directives(text)
    assert {"requeue", "no-kill"} <= asked.keys()
    name, _, seconds = asked["signal"].partition("@")
    assert name == "B:USR1"
    # A driver that takes long is stopped in time for the job to be queued again.
    assert int(seconds) >= int(exported(text)["RAY_JOB_STOP_WAIT_TIME_S"]) + 20


def test_no_port_or_folder_is_shared_with_another_job(text):
    ports = re.findall(r"--((?:[a-z]+-)*port)=(\S+)", text)
    assert dict(ports) == {
        "port": "0",
        "ray-client-server-port": '"$port"',
        "min-worker-port": "0",
        "max-worker-port": "0",
        "dashboard-agent-listen-port": "0",
    }
    assert "mktemp -d" in text


def test_it_says_in_one_line_what_is_to_be_mended(bare, tmp_path):
    job = {"SLURM_JOB_ID": "1"}
    for done, words in (
        (bare("run", "my.toml"), "sbatch"),
        (bare(**job), "no command"),
        (bare("run", LMTR_ENV=str(tmp_path / "none"), **job), "LMTR_ENV"),
        (bare("run", "my.toml", **job), "lmtr is not on the PATH"),
    ):
        assert done.returncode == 2
        assert done.stderr.count("\n") == 1, done.stderr
        assert words in done.stderr
