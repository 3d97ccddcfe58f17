"""The problem's functions and its linear solver, as machine code from the cache of libraries."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import casadi as ca

from lmtr.errors import CompilationError
from lmtr.expert.formulation import Formulation
from lmtr.expert.kkt.source import KERNEL_FLAGS, source
from lmtr.expert.kkt.structure import KktStructure
from lmtr.expert.shared_library import shared_library

Built = TypeVar("Built")


@dataclass(frozen=True)
class BuildReport:
    """How something to be compiled came to be.

    Attributes:
        compiled: Whether it runs as machine code; otherwise CasADi interprets functions, and
            MUMPS solves linear systems.
        cached: Whether that code was found in the cache.
        seconds: Time to generate, compile and load (s).
        reason: Why not; empty if it does.
    """

    compiled: bool
    cached: bool
    seconds: float
    reason: str

    def __add__(self, other: "BuildReport") -> "BuildReport":
        """Of both together."""
        return BuildReport(
            self.compiled and other.compiled,
            self.cached and other.cached,
            self.seconds + other.seconds,
            "; ".join(dict.fromkeys(reason for reason in (self.reason, other.reason) if reason)),
        )


def compiled(
    functions: list[ca.Function], cache_dir: Path | None
) -> tuple[list[ca.Function], BuildReport]:
    """The functions as machine code, or as they are with the reason why.

    Args:
        functions: Functions of distinct names.
        cache_dir: Folder of compiled libraries, made if missing; None interprets.
    """

    def build(cache: Path) -> tuple[list[ca.Function], bool]:
        # The code holds robot, scope and limits; CasADi lays down how it is called.
        library = shared_library(
            "expert", _generated(functions), cache, versions=(ca.CasadiMeta.version(),)
        )
        names = [function.name() for function in functions]
        return [ca.external(name, str(library.path)) for name in names], library.cached

    return _attempt(build, functions, cache_dir)


def compiled_linear_solver(
    problem: Formulation, cache_dir: Path | None
) -> tuple[Path | None, BuildReport]:
    """The linear solver made for a problem, as a library that IPOPT loads; or none, and why.

    Args:
        problem: The problem; where its bounds fix variables, IPOPT's systems are not those of its
            own structure.
        cache_dir: Folder of compiled libraries, made if missing; None compiles nothing.
    """
    if (problem.lower == problem.upper).any():
        return None, BuildReport(False, False, 0.0, "bounds fix some of the variables")

    def build(cache: Path) -> tuple[Path | None, bool]:
        code = source(KktStructure.of(problem))
        library = shared_library("kkt", code, cache, flags=KERNEL_FLAGS)
        return library.path, library.cached

    return _attempt(build, None, cache_dir)


def _attempt(
    build: Callable[[Path], tuple[Built, bool]], otherwise: Built, cache_dir: Path | None
) -> tuple[Built, BuildReport]:
    """What is built, and whether it came from the cache; or what there is without a compiler."""
    begin = time.perf_counter()
    if cache_dir is None:
        return otherwise, BuildReport(False, False, 0.0, "no cache folder was given")
    try:
        built, cached = build(cache_dir)
    except (CompilationError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        return otherwise, BuildReport(False, False, time.perf_counter() - begin, reason)
    return built, BuildReport(True, cached, time.perf_counter() - begin, "")


def _generated(functions: list[ca.Function]) -> str:
    generator = ca.CodeGenerator("expert.c")
    for function in functions:
        generator.add(function)
    return str(generator.dump())
