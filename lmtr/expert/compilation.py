"""Generated C code of the problem's functions: compiled once, kept in a cache, loaded.

A cache entry is one shared library named by the hash of everything that could make another one
right: the generated code (hence robot, scope, limits), CasADi, compiler, flags and processor. Its
last bytes are a digest of the rest, because loading a torn library may kill the process. Entries
appear by renaming, so any number of processes may compile at once; the last one wins, all alike.
"""

import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import casadi as ca

FLAGS = ("-O2", "-march=native", "-fPIC", "-shared")
"""Seconds to compile; the functions then take a fifth of an iteration, factoring the rest."""

COMPILERS = ("gcc", "cc", "clang")


@dataclass(frozen=True)
class BuildReport:
    """How the problem's functions came to be.

    Attributes:
        compiled: Whether they run as machine code; otherwise CasADi interprets them.
        cached: Whether that code was found in the cache.
        seconds: Time to generate, compile and load (s).
        reason: Why they are interpreted; empty if they are not.
    """

    compiled: bool
    cached: bool
    seconds: float
    reason: str


def compiled(
    functions: list[ca.Function], cache_dir: Path | None
) -> tuple[list[ca.Function], BuildReport]:
    """The functions as machine code, or as they are with the reason why.

    Args:
        functions: Functions of distinct names.
        cache_dir: Folder of compiled libraries, made if missing; None interprets.
    """
    begin = time.perf_counter()

    def interpreted(reason: str) -> tuple[list[ca.Function], BuildReport]:
        return functions, BuildReport(False, False, time.perf_counter() - begin, reason)

    if cache_dir is None:
        return interpreted("no cache folder was given")
    compiler = next((path for name in COMPILERS if (path := shutil.which(name))), None)
    if compiler is None:
        return interpreted(f"none of the compilers {', '.join(COMPILERS)} is on the path")
    try:
        code = _generated(functions)
        key = _key(code, compiler)
        library = cache_dir / f"expert-{key}.so"
        cached = _is_intact(library, key)
        if not cached:
            _compile(code, compiler, library, key)
        loaded = [ca.external(function.name(), str(library)) for function in functions]
    except (OSError, RuntimeError, subprocess.CalledProcessError) as error:
        return interpreted(f"compiling in {cache_dir} failed: {_one_line(error)}")
    return loaded, BuildReport(True, cached, time.perf_counter() - begin, "")


def _generated(functions: list[ca.Function]) -> str:
    generator = ca.CodeGenerator("expert.c")
    for function in functions:
        generator.add(function)
    return str(generator.dump())


def _key(code: str, compiler: str) -> str:
    version = subprocess.run([compiler, "--version"], capture_output=True, check=True).stdout
    parts = (code, ca.CasadiMeta.version(), version.decode(), " ".join(FLAGS), _processor())
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:24]


def _processor() -> str:
    """What ``-march=native`` depends on: the processor's model and features."""
    info = Path("/proc/cpuinfo")
    if not info.exists():
        return f"{platform.machine()} {platform.processor()}"
    first = info.read_text().split("\n\n")[0].splitlines()
    return "\n".join(line for line in first if line.startswith(("model name", "flags", "Features")))


def _digest(key: str, body: bytes) -> bytes:
    return hashlib.sha256(key.encode() + body).digest()


def _is_intact(library: Path, key: str) -> bool:
    if not library.exists():
        return False
    content = library.read_bytes()
    size = hashlib.sha256().digest_size
    return content[-size:] == _digest(key, content[:-size])


def _compile(code: str, compiler: str, library: Path, key: str) -> None:
    """Compile beside the cache entry, seal it with its digest and rename it into place."""
    library.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=library.parent, prefix=".building-") as folder:
        source, built = Path(folder) / "expert.c", Path(folder) / "expert.so"
        source.write_text(code)
        subprocess.run(
            [compiler, *FLAGS, "-o", str(built), str(source), "-lm"],
            capture_output=True,
            check=True,
        )
        # Loaders ignore what follows the sections they map.
        with built.open("ab") as file:
            file.write(_digest(key, built.read_bytes()))
        os.replace(built, library)


def _one_line(error: Exception) -> str:
    text = str(error)
    if isinstance(error, subprocess.CalledProcessError):
        said = error.stderr.decode(errors="replace")
        text = f"{Path(error.cmd[0]).name} exited with {error.returncode}: {said}"
    return " ".join(text.split())[:300]
