"""A data set is the same with any number of workers, and after Ctrl-C."""

import os
import signal
import subprocess
import sys
import time

import pytest

from services.home import Home
from services.lake.tables import Lake

pytestmark = pytest.mark.slow

NUMBERS = ["index", "status", "accepted", "reject_reasons", "cost", "iterations", "violations",
           "start_feet", "goal_pose", "obstacles", "noise_timing", "base_nodes", "contact_times",
           "footholds", "swing_nodes", "force_nodes"]  # fmt: skip


COUNT = 80
"""Solutions: enough that a driver is still at work after its first commit."""


def generate(config, home, *options, log=False):
    command = [
        sys.executable,
        "-m",
        "pipelines",
        "generate",
        "-c",
        str(config),
        "--home",
        str(home),
    ]
    return subprocess.Popen(
        [*command, *map(str, options)],
        start_new_session=True,
        stderr=subprocess.PIPE if log else None,
        text=True,
    )


def rows(home):
    lake = Lake(Home.open(home, create=False).lake)
    return lake.read("solutions", NUMBERS, order_by="index").to_pylist()


@pytest.fixture(scope="module")
def undisturbed(tiny_config, tmp_path_factory):
    """What one worker makes."""
    home = tmp_path_factory.mktemp("undisturbed") / "home"
    assert generate(tiny_config, home, "--solutions", COUNT, "--workers", 1).wait() == 0
    return rows(home)


def test_two_workers_make_the_same_numbers_as_one(tiny_config, tmp_path, undisturbed):
    home = tmp_path / "home"
    assert generate(tiny_config, home, "--solutions", COUNT, "--workers", 2).wait() == 0
    assert rows(home) == undisturbed


def test_after_ctrl_c_a_data_set_is_continued_without_a_lost_or_doubled_row(
    tiny_config, tmp_path, undisturbed
):
    home = tmp_path / "home"
    options = ("--solutions", COUNT, "--workers", 2, "--set", "cluster.commit_items=2")
    driver = generate(tiny_config, home, *options, log=True)
    while not committed(home):
        assert driver.poll() is None, "the driver ended before it committed anything"
        time.sleep(0.02)
    os.killpg(driver.pid, signal.SIGINT)
    _, said = driver.communicate(timeout=60)
    assert driver.returncode == 130
    assert "what was finished is kept" in said
    assert "Traceback" not in said
    assert 0 < len(rows(home)) < COUNT
    assert generate(tiny_config, home, *options).wait() == 0
    assert rows(home) == undisturbed


def committed(home):
    """Rows that are in the lake by now."""
    if not (home / "lake" / "solutions" / "_delta_log").is_dir():
        return 0
    return Lake(home / "lake").query_value("SELECT count(*) FROM solutions")
