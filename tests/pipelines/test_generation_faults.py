"""A data set is the same with any number of workers, and after a driver that was killed."""

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


COUNT = 24
"""Solutions: enough that a driver is still at work when it is stopped."""


def generate(config, home, *options):
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
    return subprocess.Popen([*command, *map(str, options)], start_new_session=True)


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


@pytest.mark.parametrize("fault", [signal.SIGINT, signal.SIGKILL])
def test_a_stopped_driver_is_continued_without_a_lost_or_doubled_row(
    tiny_config, tmp_path, undisturbed, fault
):
    home = tmp_path / "home"
    # Rows are committed by the batch, so a kill can cost only those of the last one.
    assert generate(tiny_config, home, "--solutions", 3, "--workers", 0).wait() == 0
    driver = generate(tiny_config, home, "--solutions", COUNT, "--workers", 2)
    time.sleep(12.0)
    os.killpg(driver.pid, fault)
    assert driver.wait(timeout=60) in (130, -fault)
    assert len(rows(home)) >= 3
    assert generate(tiny_config, home, "--solutions", COUNT, "--workers", 2).wait() == 0
    assert rows(home) == undisturbed
