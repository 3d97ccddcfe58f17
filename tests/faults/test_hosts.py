"""A cluster of three hosts: one is powered off in the middle of the work, one is cut off."""

import time

import pytest

from tests.faults.driver import COUNT, Driver, require_complete
from tests.faults.hosts import Hosts

pytestmark = pytest.mark.slow


@pytest.fixture
def hosts():
    if obstacle := Hosts.obstacle():
        pytest.skip(obstacle)
    with Hosts(3) as three:
        three.start()
        yield three


def test_a_host_powered_off_and_one_cut_off_cost_no_row(home, config, reference, hosts):
    options = ("--set", f"cluster.address={hosts.address}")
    with Driver(home, config, *options, workers=3, before=hosts.entered(0, [])) as driver:
        driver.await_rows(COUNT // 8)
        hosts.power_off(1)
        off = time.monotonic()
        driver.await_rows(COUNT // 2)
        hosts.partition(2)
        cut = time.monotonic()
        status, said = driver.end()
        done = time.monotonic()
    print(
        f"complete {done - off:.1f} s after a host went off, {done - cut:.1f} s after one was cut"
    )
    assert status == 0, said
    require_complete(home, reference)
    await_count(hosts, 1)  # both are missed
    print(f"missed {time.monotonic() - cut:.1f} s after the second was cut off")
    hosts.heal(2)
    await_count(hosts, 2)  # the one that was cut off is back


def await_count(hosts, count):
    """Return when Ray counts so many hosts."""
    until = time.monotonic() + 90.0
    while (alive := hosts.count_alive()) != count:
        assert time.monotonic() < until, f"Ray counts {alive} hosts and not {count}"
        time.sleep(0.5)
