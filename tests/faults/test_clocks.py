"""Clocks that jump by a day while a generation runs."""

import subprocess
from pathlib import Path

import pytest

from tests.faults.driver import COUNT, Driver, require_complete

pytestmark = pytest.mark.slow

LIBRARIES = "lib/*/faketime/libfaketimeMT.so.1"

SLEEP = """
#define _GNU_SOURCE
#include <errno.h>
#include <time.h>
#include <unistd.h>
#include <sys/syscall.h>
int clock_nanosleep(clockid_t clock, int flags, const struct timespec *until, struct timespec *left)
{
    return syscall(SYS_clock_nanosleep, clock, flags, until, left) ? errno : 0;
}
"""
"""Sleeps by the monotonic clock as the kernel has them: libfaketime 0.9.10 refuses them (EINVAL)
where it leaves that clock alone, and Python's ``time.sleep`` is one."""


@pytest.fixture
def clock(tmp_path):
    """The wall clock of processes with its environment, and what sets it."""
    found = sorted(Path("/usr").glob(LIBRARIES))
    if not found:
        pytest.skip("clocks cannot be set for single processes here: install faketime")
    offset = tmp_path / "offset"
    offset.write_text("+0\n")
    environment = {
        "LD_PRELOAD": f"{compiled_sleep(tmp_path)}:{found[0]}",
        "FAKETIME_TIMESTAMP_FILE": str(offset),
        "FAKETIME_NO_CACHE": "1",
        "DONT_FAKE_MONOTONIC": "1",
        "FAKETIME_DONT_FAKE_MONOTONIC": "1",
    }

    def jump(by):
        fresh = offset.with_suffix(".new")
        fresh.write_text(f"{by}\n")
        fresh.replace(offset)  # never seen half written

    return environment, jump


def compiled_sleep(folder):
    library = folder / "sleep.so"
    command = ["cc", "-shared", "-fPIC", "-x", "c", "-", "-o", library]
    subprocess.run(command, input=SLEEP, text=True, check=True)
    return library


def test_clocks_that_jump_a_day_forward_and_back_change_nothing(home, config, reference, clock):
    environment, jump = clock
    with Driver(home, config, environment=environment) as driver:
        for share, offset in ((0.1, "+1d"), (0.4, "-1d"), (0.7, "+0")):
            driver.await_rows(int(share * COUNT))
            jump(offset)
        status, said = driver.end()
    assert status == 0, said
    require_complete(home, reference)
