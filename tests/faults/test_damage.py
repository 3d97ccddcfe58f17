"""Files of the lake that were damaged on the disk: found, set aside, made again."""

import shutil
import signal

import pytest

from benchmarks.processes import Role
from services.home import Home
from services.lake.tables import Lake
from tests.faults.driver import COUNT, Driver, finish, lmtr, require_complete

pytestmark = pytest.mark.slow


def mended(home, config, reference):
    """Check finds it, repair sets it aside, generate fills the gap, check is clean."""
    checked = lmtr("--home", home, "lake", "check")
    assert checked.returncode == 1, checked.stdout + checked.stderr
    assert "solutions" in checked.stdout + checked.stderr
    repaired = lmtr("--home", home, "lake", "repair")
    assert repaired.returncode == 0, repaired.stdout + repaired.stderr
    assert "lmtr generate" in repaired.stdout + repaired.stderr
    finish(home, config)
    require_complete(home, reference)


def test_a_damaged_parquet_file_costs_its_rows_until_they_are_made_again(
    home, config, undisturbed, reference
):
    shutil.copytree(undisturbed, home)
    table = Lake(Home.open(home, create=False).lake).delta("solutions")
    file = home / "lake" / "solutions" / table.get_add_actions(flatten=True)["path"][0].as_py()
    content = bytearray(file.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 64] = bytes(byte ^ 0xFF for byte in content[middle : middle + 64])
    file.write_bytes(content)
    mended(home, config, reference)


def test_a_torn_log_entry_costs_its_rows_until_they_are_made_again(home, config, reference):
    with Driver(home, config) as driver:
        driver.await_rows(COUNT // 2)
        driver.kill(Role.DRIVER)
        assert driver.end()[0] == -signal.SIGKILL
    newest = max((home / "lake" / "solutions" / "_delta_log").glob("*.json"))
    content = newest.read_bytes()
    newest.write_bytes(content[: len(content) // 2])
    mended(home, config, reference)
