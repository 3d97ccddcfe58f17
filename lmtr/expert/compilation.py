"""Generated C code of the problem's functions, as machine code from the cache of libraries."""

import time
from dataclasses import dataclass
from pathlib import Path

import casadi as ca

from lmtr.errors import CompilationError
from lmtr.expert.shared_library import shared_library


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
    if cache_dir is None:
        return functions, BuildReport(False, False, 0.0, "no cache folder was given")
    try:
        # The code holds robot, scope and limits; CasADi lays down how it is called.
        library = shared_library(
            "expert", _generated(functions), cache_dir, versions=(ca.CasadiMeta.version(),)
        )
        loaded = [ca.external(function.name(), str(library.path)) for function in functions]
    except (CompilationError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        return functions, BuildReport(False, False, time.perf_counter() - begin, reason)
    return loaded, BuildReport(True, library.cached, time.perf_counter() - begin, "")


def _generated(functions: list[ca.Function]) -> str:
    generator = ca.CodeGenerator("expert.c")
    for function in functions:
        generator.add(function)
    return str(generator.dump())
