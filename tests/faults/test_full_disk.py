"""A disk that fills up while rows are written to it."""

import errno
import os
import subprocess

import pytest

from tests.faults.driver import COUNT, Driver, committed, finish, require_complete, require_one_line

pytestmark = pytest.mark.slow

SMALL, LARGE = "32m", "256m"


@pytest.fixture
def disk(tmp_path):
    """A small disk of its own, that can be made larger."""
    folder = tmp_path / "disk"
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={SMALL}", "tmpfs", str(folder)]
    mounted = subprocess.run(command, capture_output=True, text=True, check=False)
    if mounted.returncode:
        pytest.skip(f"a disk cannot be mounted here: {mounted.stderr.strip()}")
    yield folder
    subprocess.run(["umount", "--lazy", folder], check=True)


def fill(folder):
    """Take all the room that is left."""
    with (folder / "ballast").open("wb", buffering=0) as file:
        for size in (1 << 20, 1 << 12):
            with pytest.raises(OSError, match=os.strerror(errno.ENOSPC)):
                write_on(file, size)


def write_on(file, size):
    while True:
        file.write(bytes(size))


def test_a_full_disk_is_named_and_with_more_room_the_command_goes_on(disk, config, reference):
    home = disk / "home"
    with Driver(home, config) as driver:
        driver.await_rows(COUNT // 4)
        fill(disk)
        status, said = driver.end()
    assert status == 2, said
    require_one_line(said, os.strerror(errno.ENOSPC))
    assert 0 < committed(home) < COUNT
    subprocess.run(["mount", "-o", f"remount,size={LARGE}", disk], check=True)
    finish(home, config)
    require_complete(home, reference)
