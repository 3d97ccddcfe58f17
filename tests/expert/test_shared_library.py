"""The cache of shared libraries under real faults: torn, foreign, raced for, killed, refused."""

import ctypes
import fcntl
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import pytest

from lmtr.errors import CompilationError
from lmtr.expert import shared_library as cache
from lmtr.expert.shared_library import shared_library

DAY = 86400.0

BUILD = """
import ctypes, sys
from pathlib import Path
from lmtr.expert.shared_library import shared_library
library = shared_library("twice", sys.argv[2], Path(sys.argv[1]))
call = ctypes.CDLL(str(library.path)).times
call.restype, call.argtypes = ctypes.c_double, [ctypes.c_double]
print(library.cached, call(21.0))
"""
"""Builds in a process of its own and says whether it was cached and what twice 21 is."""


def source(factor=2.0):
    return f"double times(double x) {{ return {factor} * x; }}\n"


def times(library, value=21.0):
    call = ctypes.CDLL(str(library.path)).times
    call.restype, call.argtypes = ctypes.c_double, [ctypes.c_double]
    return call(value)


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "cache"


@pytest.fixture
def compiler(tmp_path, monkeypatch):
    """Puts a compiler of one's own on the path, which begins with the given shell commands.

    Every compilation, but not the question for the version, leaves a line in ``log``.
    """
    tools, real = tmp_path / "tools", shutil.which("gcc")
    tools.mkdir()
    log = tmp_path / "log"
    log.touch()

    def install(commands):
        script = f"""#!/bin/sh
if [ "$1" = --version ]; then exec {real} --version; fi
echo compiles >> {log}
{commands}
exec {real} "$@"
"""
        (tools / "gcc").write_text(script)
        (tools / "gcc").chmod(0o755)
        return log

    monkeypatch.setenv("PATH", f"{tools}{os.pathsep}{os.environ['PATH']}")
    return install


@pytest.fixture
def start():
    """Starts ``BUILD`` in a group of processes that ends with the test."""
    groups = []

    def build(folder, code=BUILD):
        command = [sys.executable, "-c", code, str(folder), source()]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        process = subprocess.Popen(command, start_new_session=True, **pipes)
        groups.append(process)
        return process

    yield build
    for process in groups:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def wait_for(path):
    for _ in range(600):
        if path.exists():
            return
        time.sleep(0.05)
    pytest.fail(f"{path.name} never came")


def test_a_library_is_made_once_and_found_again(folder):
    made, found = shared_library("twice", source(), folder), None
    found = shared_library("twice", source(), folder)
    assert (made.cached, found.cached) == (False, True)
    assert made.path == found.path
    assert times(found) == 42.0
    assert folder.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("damage", ["truncated", "flipped", "empty", "renamed", "without its seal"])
def test_a_damaged_entry_is_made_again(folder, damage):
    entry = shared_library("twice", source(), folder).path
    other = shared_library("twice", source(3.0), folder).path
    whole = entry.read_bytes()
    damaged = {
        "truncated": whole[: len(whole) // 2],
        "flipped": whole[:2000] + bytes([whole[2000] ^ 1]) + whole[2001:],
        "empty": b"",
        "renamed": other.read_bytes(),
        "without its seal": whole[:-32],
    }
    entry.write_bytes(damaged[damage])
    mended = shared_library("twice", source(), folder)
    assert not mended.cached
    assert times(mended) == 42.0
    assert shared_library("twice", source(), folder).cached


def test_whatever_decides_the_code_makes_another_entry(folder, compiler, tmp_path, monkeypatch):
    def made(code=None, **options):
        return shared_library("twice", code or source(), folder, **options).path

    entries = [
        made(),
        made(source(3.0)),
        made(flags=(*cache.FLAGS, "-DOTHER")),
        made(versions=("1.0",)),
        made(versions=("1.", "0")),
    ]
    compiler("")
    script = tmp_path / "tools" / "gcc"
    script.write_text(script.read_text().replace("exec", "echo of my own; exec", 1))
    entries.append(made())
    monkeypatch.setattr(cache, "_processor", lambda: "another one")
    entries.append(made())
    assert len(set(entries)) == len(entries)


def test_of_four_processes_one_compiles_and_the_others_wait_for_it(folder, compiler, start):
    log = compiler("sleep 1")
    processes = [start(folder) for _ in range(4)]
    printed = sorted(process.communicate()[0] for process in processes)
    assert printed == ["False 42.0\n", *["True 42.0\n"] * 3]
    assert log.read_text() == "compiles\n"


def test_a_killed_process_holds_nobody_up_and_its_site_is_cleared(
    folder, compiler, start, tmp_path
):
    compiler(f"touch {tmp_path}/begun; sleep 600")
    holder = start(folder)
    wait_for(tmp_path / "begun")
    holder.kill()
    holder.wait()
    compiler("")
    begin = time.monotonic()
    assert times(shared_library("twice", source(), folder)) == 42.0
    assert time.monotonic() - begin < cache.PATIENCE_S / 2
    (site,) = folder.glob(".building-*")
    os.utime(site, (time.time() - 2 * DAY,) * 2)
    shared_library("twice", source(3.0), folder)
    assert not site.exists()


def test_who_waited_long_enough_compiles_himself(folder, monkeypatch):
    monkeypatch.setattr(cache, "PATIENCE_S", 0.2)
    first = shared_library("twice", source(), folder)
    first.path.unlink()
    (lock,) = folder.glob(".lock-*")
    with lock.open("a") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        again = shared_library("twice", source(), folder)
    assert not again.cached
    assert times(again) == 42.0


def test_a_compiler_that_never_ends_is_given_up(folder, compiler, tmp_path, monkeypatch):
    compiler(f"sleep 600 & echo $! > {tmp_path}/child; exec sleep 600")
    monkeypatch.setattr(cache, "COMPILER_LIMIT_S", 1.0)
    with pytest.raises(CompilationError, match="gcc did not end within 1 s") as caught:
        shared_library("twice", source(), folder)
    assert isinstance(caught.value.__cause__, subprocess.TimeoutExpired)
    # Its own children may outlive it; nobody waits for them. They are there to be killed.
    os.kill(int((tmp_path / "child").read_text()), signal.SIGKILL)
    assert not list(folder.glob("*.so"))


def test_what_a_failing_compiler_says_is_passed_on(folder):
    with pytest.raises(CompilationError, match=r"exited with 1: .*error") as caught:
        shared_library("twice", "no C at all\n", folder)
    assert "\n" not in str(caught.value)
    assert list(folder.glob("*.so")) == list(folder.glob(".building-*")) == []


def test_without_a_compiler_its_names_are_told(folder, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(CompilationError, match="gcc, cc, clang is on the path; install one"):
        shared_library("twice", source(), folder)


@pytest.mark.parametrize("mode", [0o770, 0o707, 0o777, 0o1777])
def test_a_cache_that_others_can_write_to_is_refused(folder, mode):
    folder.mkdir()
    folder.chmod(mode)
    with pytest.raises(CompilationError, match=r"written by others.*chmod go-w"):
        shared_library("twice", source(), folder)
    assert list(folder.iterdir()) == []


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a folder away")
def test_a_cache_of_another_user_is_refused(folder):
    folder.mkdir(mode=0o700)
    os.chown(folder, 12345, -1)
    with pytest.raises(CompilationError, match=r"belongs to user 12345.*of your own"):
        shared_library("twice", source(), folder)


def test_a_cache_that_may_only_be_read_serves_what_it_holds(start):
    unprivileged = """
import ctypes, os
import lmtr.expert.shared_library
if os.geteuid() == 0:
    os.setgid(65534)
    os.setuid(65534)
"""
    with tempfile.TemporaryDirectory(dir="/tmp") as place:
        folder = Path(place)
        shared_library("twice", source(), folder)
        folder.chmod(0o555)
        out, err = start(folder, unprivileged + BUILD).communicate()
        assert out == "True 42.0\n", err
        another = BUILD.replace("sys.argv[2]", "'/* another */' + sys.argv[2]")
        out, err = start(folder, unprivileged + another).communicate()
        assert "CompilationError: compiling in" in err
        assert "Permission denied" in err
        folder.chmod(0o700)


def test_a_disk_without_room_leaves_no_torn_entry(folder, start):
    cramped = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (8000, 8000))\n"
    out, err = start(folder, cramped + BUILD).communicate()
    assert out == ""
    assert "CompilationError: compiling in" in err
    assert not list(folder.glob("*.so"))
    assert times(shared_library("twice", source(), folder)) == 42.0


def age(path, days):
    os.utime(path, (time.time() - days * DAY,) * 2)


def test_what_nobody_used_for_long_goes_and_what_is_loaded_works_on(folder):
    used, unused, recent, busy = (
        shared_library("entry", source(factor), folder) for factor in (2.0, 3.0, 4.0, 5.0)
    )
    call = ctypes.CDLL(str(unused.path)).times
    call.restype, call.argtypes = ctypes.c_double, [ctypes.c_double]
    for library, days in ((used, 61), (unused, 61), (recent, 59), (busy, 61)):
        age(library.path, days)
    assert shared_library("entry", source(2.0), folder).cached
    key = busy.path.stem.rpartition("-")[2]
    with (folder / f".lock-{key[0]}").open("a") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        cache._prune(folder)
        kept = {library.path.exists() for library in (used, recent, busy)}
    cache._prune(folder)
    assert kept == {True}
    assert not busy.path.exists()
    assert not unused.path.exists()
    assert call(21.0) == 63.0
