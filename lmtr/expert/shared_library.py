"""C sources as shared libraries: compiled once per machine, kept in a cache of one's own.

An entry is named by the hash of everything that could make another one right: the code, the
compiler, its flags and the processor. Its last bytes are a digest of the rest, because loading a
torn library may kill the process. Entries appear by renaming, so that whoever loads one has a whole
one; processes that want the same one wait for the first instead of compiling it again.

What lies in the cache is executed, so a folder that others can write to is refused.
"""

import fcntl
import hashlib
import os
import platform
import shutil
import stat
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from lmtr.errors import CompilationError

FLAGS = ("-O2", "-march=native", "-fPIC", "-shared")
"""Flags for machine code of this very processor."""

COMPILERS = ("gcc", "cc", "clang")

PATIENCE_S = 120.0
"""How long a process waits for another one's library before it compiles its own (s)."""

COMPILER_LIMIT_S = 600.0
"""How long a compiler may take (s)."""

UNUSED_S = 60 * 86400.0
"""Entries that nobody loaded for so long are removed (s)."""

ABANDONED_S = 86400.0
"""Building sites of this age belong to processes that were killed (s)."""

_SITE = ".building-"


@dataclass(frozen=True)
class Library:
    """A shared library that can be loaded.

    Attributes:
        path: Where it lies.
        cached: Whether it was found there, and not just made.
        seconds: Time that it took to have it (s).
    """

    path: Path
    cached: bool
    seconds: float


def shared_library(
    name: str,
    code: str,
    cache_dir: Path,
    *,
    flags: Sequence[str] = FLAGS,
    versions: Sequence[str] = (),
) -> Library:
    """The library that a C source compiles to, from the cache if it is there and intact.

    Load it soon: entries that nobody asked for in two months are removed.

    Args:
        name: First part of the entry's name.
        code: The C source, self-contained but for the standard library and libm.
        cache_dir: The cache, made if missing, readable and writable by its owner alone.
        flags: The compiler's flags.
        versions: Further things that decide which code is right, such as versions of libraries.

    Raises:
        CompilationError: There is no compiler, it failed, or the cache cannot be used.
    """
    begin = time.perf_counter()
    compiler = c_compiler()
    if compiler is None:
        raise CompilationError(
            f"none of the compilers {', '.join(COMPILERS)} is on the path; install one"
        )
    try:
        require_private(cache_dir)
        key = _key(code, compiler, flags, versions)
        path = cache_dir / f"{name}-{key}.so"
        with _turn(cache_dir, key, PATIENCE_S):
            cached = _is_intact(path, key)
            if cached:
                _mark_used(path)
            else:
                _build(code, compiler, flags, path, key)
        if not cached:
            _prune(cache_dir)
    except (OSError, subprocess.SubprocessError) as error:
        raise CompilationError(f"compiling in {cache_dir} failed: {_one_line(error)}") from error
    return Library(path, cached, time.perf_counter() - begin)


def c_compiler() -> str | None:
    """Path of the C compiler that is used; none if there is none."""
    return next((path for name in COMPILERS if (path := shutil.which(name))), None)


def require_private(cache_dir: Path) -> None:
    """Make the cache if it is missing; refuse one that others could put code into.

    Raises:
        CompilationError: It belongs to somebody else, or others may write to it.
        OSError: It cannot be made.
    """
    cache_dir.mkdir(mode=0o700, parents=True, exist_ok=True)
    found = cache_dir.stat()
    if found.st_uid not in (os.geteuid(), 0):
        raise CompilationError(
            f"cache {cache_dir} belongs to user {found.st_uid}, who could put code into it; "
            "name a folder of your own"
        )
    if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise CompilationError(
            f"cache {cache_dir} can be written by others (mode {found.st_mode & 0o777:o}), who "
            f"could put code into it; forbid it with `chmod go-w {cache_dir}`"
        )


def _key(code: str, compiler: str, flags: Sequence[str], versions: Sequence[str]) -> str:
    parts = (code, _version(compiler), " ".join(flags), _processor(), *versions)
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:24]


def _version(compiler: str) -> str:
    run = subprocess.run(
        [compiler, "--version"], capture_output=True, check=True, timeout=COMPILER_LIMIT_S
    )
    return run.stdout.decode(errors="replace")


@cache
def _processor() -> str:
    """What ``-march=native`` depends on: the processor's model and features."""
    info = Path("/proc/cpuinfo")
    if not info.exists():
        return f"{platform.machine()} {platform.processor()}"
    first = info.read_text().split("\n\n")[0].splitlines()
    return "\n".join(line for line in first if line.startswith(("model name", "flags", "Features")))


@contextmanager
def _turn(cache_dir: Path, key: str, patience: float) -> Iterator[bool]:
    """Be the only process of this machine at entries of this key; gives whether one is.

    After ``patience`` (s), or where nothing can be locked, go on regardless: renaming keeps the
    entries whole, and only work is done twice. The kernel releases the lock when its holder ends,
    however it ends. A few fixed files serve all keys, since removing a lock's file is a race.
    """
    try:
        file = (cache_dir / f".lock-{key[0]}").open("a", encoding="ascii")
    except OSError:
        yield False
        return
    with file:
        yield _locked(file.fileno(), patience)


def _locked(descriptor: int, patience: float) -> bool:
    deadline = time.monotonic() + patience
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        except BlockingIOError:
            if time.monotonic() >= deadline:
                return False
            time.sleep(0.05)
        except OSError:  # a file system without locks
            return False


def _digest(key: str, body: bytes) -> bytes:
    return hashlib.sha256(key.encode() + body).digest()


def _is_intact(path: Path, key: str) -> bool:
    """Whether the entry is whole and the one that its name says."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return False
    size = hashlib.sha256().digest_size
    return content[-size:] == _digest(key, content[:-size])


def _build(code: str, compiler: str, flags: Sequence[str], path: Path, key: str) -> None:
    """Compile beside the cache entry, seal it with its digest and rename it into place."""
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=_SITE) as folder:
        source, built = Path(folder) / "source.c", Path(folder) / "library.so"
        source.write_text(code, encoding="utf-8")
        _run([compiler, *flags, "-o", str(built), str(source), "-lm"], Path(folder) / "said")
        # Loaders ignore what follows the sections they map.
        with built.open("ab") as file:
            file.write(_digest(key, built.read_bytes()))
        os.replace(built, path)


def _run(command: list[str], said: Path) -> None:
    """Run a compiler; what it says goes to a file.

    A pipe would be held open by the compiler's own children when it is stopped for being late.
    """
    with said.open("wb") as file:
        run = subprocess.run(
            command, stdout=file, stderr=file, check=False, timeout=COMPILER_LIMIT_S
        )
    if run.returncode:
        raise subprocess.CalledProcessError(run.returncode, command, stderr=said.read_bytes())


def _mark_used(path: Path) -> None:
    """Keep an entry from being removed; a cache that is only read is not pruned either."""
    with suppress(OSError):
        os.utime(path)


def _prune(cache_dir: Path) -> None:
    """Remove what nobody used for long; processes that have loaded it keep their own mapping."""
    now = time.time()
    for site in cache_dir.glob(f"{_SITE}*"):
        with suppress(OSError):
            if now - site.stat().st_mtime > ABANDONED_S:
                shutil.rmtree(site, ignore_errors=True)
    for entry in cache_dir.glob("*-*.so"):
        key = entry.stem.rpartition("-")[2]
        # In its turn: nobody can be between finding this entry intact and marking it used.
        with suppress(OSError), _turn(cache_dir, key, 0.0) as alone:
            if alone and now - entry.stat().st_mtime > UNUSED_S:
                entry.unlink()


def _one_line(error: Exception) -> str:
    text = str(error)
    if isinstance(error, subprocess.CalledProcessError):
        said = error.stderr.decode(errors="replace")
        text = f"{Path(error.cmd[0]).name} exited with {error.returncode}: {said}"
    elif isinstance(error, subprocess.TimeoutExpired):
        text = f"{Path(error.cmd[0]).name} did not end within {error.timeout:.0f} s"
    return " ".join(text.split())[:300]
