"""Two drivers on one data set, with the lock that tells them of each other and without it."""

import subprocess
import sys
import time
from collections import Counter

import pytest

from tests.faults.driver import (
    COUNT,
    Driver,
    history,
    require_complete,
    require_one_line,
    rows,
)
from tests.faults.gated import OPEN

pytestmark = pytest.mark.slow

GATED_COUNT = 120
"""Solutions of the data set that two drivers begin at once."""

APART = ["unshare", "--mount", "sh", "-c", 'mount -t tmpfs tmpfs "$0" && exec "$@"']
"""Runs a command for which a folder is another one than for everybody else."""


def test_the_second_driver_says_that_the_first_holds_the_data_set(home, config, reference):
    with Driver(home, config) as first:
        first.await_rows(COUNT // 8)
        with Driver(home, config) as second:
            status, said = second.end()
        assert first.runs
        assert first.end()[0] == 0
    assert status == 2
    require_one_line(said, str(first.pid), "is busy with")
    require_complete(home, reference)


def test_two_drivers_that_do_not_know_of_each_other_make_each_row_once(home, tmp_path):
    gate, locks = tmp_path / "gate", home / "locks"
    gate.mkdir()
    with gated(home, gate, "first") as first:
        await_file(gate / "first.ready", first)
        tried = subprocess.run([*APART, locks, "true"], capture_output=True, text=True, check=False)
        if tried.returncode:
            pytest.skip(f"no locks of its own for a process here: {tried.stderr.strip()}")
        with gated(home, gate, "second", before=[*APART, str(locks)]) as second:
            await_file(gate / "second.ready", second)
            (gate / OPEN).touch()
            ends = [second.end(), first.end()]
    assert [status for status, _ in ends] == [0, 0], ends
    writers = Counter()
    for commit in history(home):
        if commit["operation"] == "WRITE":
            writers[commit["lmtr.code_version"]] += commit["operationMetrics"]["num_added_rows"]
    assert set(writers) == {"first", "second"}
    assert writers.total() == GATED_COUNT
    assert min(writers.values()) > GATED_COUNT // 10
    calm = tmp_path / "calm"
    with gated(calm, gate, "calm", workers=0) as alone:
        assert alone.end()[0] == 0
    require_complete(home, rows(calm))


def gated(home, gate, name, workers=1, **changes):
    """A driver whose workers wait at the gate."""
    words = ("--home", home, "--gate", gate, "--name", name, "--solutions", GATED_COUNT)
    command = [sys.executable, "-m", "tests.faults.gated", *map(str, words)]
    return Driver(home, None, "--workers", workers, command=command, **changes)


def await_file(path, driver):
    """Return when a file is there."""
    until = time.monotonic() + 60.0
    while not path.exists():
        assert driver.runs, f"the driver ended: {driver.end()}"
        assert time.monotonic() < until, f"{path.name} never came"
        driver.members()
        time.sleep(0.05)
