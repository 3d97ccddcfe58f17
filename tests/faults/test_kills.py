"""SIGKILL of each process of a generation, and the signals that stop it kindly."""

import signal

import pytest

from benchmarks.processes import Role, left_over
from tests.faults.driver import (
    COUNT,
    Driver,
    committed,
    finish,
    mended,
    require_complete,
    require_one_line,
)

pytestmark = pytest.mark.slow

GONE_S = 30.0
"""After so long nothing of a driver that has ended may run any more (s)."""

AGENTS_GONE_S = 100.0
"""After a SIGKILL of the driver Ray's own agents wait a minute for their raylet before they go."""


@pytest.mark.parametrize(
    ("role", "trouble"), [(Role.WORKER, "worker_died"), (Role.WRITER, "writer_died")]
)
def test_a_process_that_is_killed_again_and_again_costs_no_row(
    home, config, reference, role, trouble
):
    with Driver(home, config) as driver:
        for share in (0.1, 0.4, 0.7):
            driver.await_rows(int(share * COUNT))
            driver.kill(role)
        status, said = driver.end()
        assert status == 0, said
        assert left_over(driver.members(), GONE_S) == []
    # Three times one writer or both workers; one that has just answered holds nothing when it dies.
    assert 1 <= mended(home)[trouble] <= 6
    require_complete(home, reference)


def test_a_killed_driver_takes_all_with_it_and_is_continued(home, config, reference):
    with Driver(home, config) as driver:
        driver.await_rows(COUNT // 4)
        driver.kill(Role.DRIVER)
        assert driver.end()[0] == -signal.SIGKILL
        assert committed(home) < COUNT
        finish(home, config)
        assert left_over(driver.members(), AGENTS_GONE_S) == []
    require_complete(home, reference)


def test_without_its_raylet_a_driver_starts_ray_again_and_goes_on(home, config, reference):
    with Driver(home, config) as driver:
        driver.await_rows(COUNT // 4)
        driver.kill(Role.RAYLET)
        status, said = driver.end()
        assert status == 0, said
        assert left_over(driver.members(), GONE_S) == []
    assert "Traceback" not in said
    assert mended(home)["cluster_lost"] == 1
    require_complete(home, reference)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_driver_that_shall_stop_keeps_what_is_solved_and_says_how_to_go_on(
    home, config, reference, number
):
    with Driver(home, config) as driver:
        driver.await_rows(COUNT // 4)
        driver.signal(number)
        status, said = driver.end()
        assert status == 130, said
        require_one_line(said, "run the same command to go on")
        assert left_over(driver.members(), GONE_S) == []
    assert COUNT // 4 <= committed(home) < COUNT
    finish(home, config)
    require_complete(home, reference)
