"""Two drivers on one data set, with the lock that tells them of each other and without it."""

import subprocess

import pytest

from tests.faults.driver import COUNT, Driver, require_complete, require_one_line

pytestmark = pytest.mark.slow

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


def test_two_drivers_that_do_not_know_of_each_other_make_each_row_once(home, config, reference):
    with Driver(home, config, workers=1) as first:
        first.await_rows(1)
        locks = home / "locks"
        tried = subprocess.run([*APART, locks, "true"], capture_output=True, text=True, check=False)
        if tried.returncode:
            pytest.skip(f"no locks of its own for a process here: {tried.stderr.strip()}")
        with Driver(home, config, workers=1, before=[*APART, str(locks)]) as second:
            second_end = second.end()
        assert first.end()[0] == 0
    assert second_end[0] == 0, second_end[1]
    require_complete(home, reference)
