"""The problem's functions and its linear solver, as machine code from the cache of libraries."""

import ctypes
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


FUNCTIONS, LINEAR_SOLVER = "functions", "linear solver"
"""Parts of an expert that are compiled."""

_LOSSES = {
    frozenset({FUNCTIONS, LINEAR_SOLVER}): "the expert runs interpreted and solves linear systems "
    "with MUMPS, which takes four times as long",
    frozenset({FUNCTIONS}): "the expert runs interpreted, which takes twice as long",
    frozenset({LINEAR_SOLVER}): "the expert solves linear systems with MUMPS, which takes nearly "
    "three times as long",
    frozenset[str](): "",
}
"""What is lost without machine code of parts; default problems of ANYmal take 0.21 s of processor
time with all, 0.45 s without functions, 0.58 s without the linear solver, 0.87 s without both."""


@dataclass(frozen=True)
class BuildReport:
    """How something to be compiled came to be.

    Attributes:
        missing: Parts that are no machine code: CasADi interprets functions then, and MUMPS
            solves linear systems.
        cached: Whether that code was found in the cache.
        seconds: Time to generate, compile and load (s).
        reason: Why parts are missing; empty if none is.
    """

    missing: frozenset[str]
    cached: bool
    seconds: float
    reason: str

    @property
    def compiled(self) -> bool:
        """Whether all of it runs as machine code."""
        return not self.missing

    @property
    def loss(self) -> str:
        """What the missing parts mean, for people; empty if none is."""
        return _LOSSES[self.missing]

    def __add__(self, other: "BuildReport") -> "BuildReport":
        """Of both together."""
        return BuildReport(
            self.missing | other.missing,
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

    return _attempt(FUNCTIONS, build, functions, cache_dir)


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
        missing = frozenset({LINEAR_SOLVER})
        return None, BuildReport(missing, False, 0.0, "bounds fix some of the variables")

    def build(cache: Path) -> tuple[Path | None, bool]:
        code = source(KktStructure.of(problem))
        library = shared_library("kkt", code, cache, flags=KERNEL_FLAGS)
        try:  # IPOPT would take one that cannot be loaded for an option that is wrong
            ctypes.CDLL(str(library.path))
        except OSError as error:
            raise CompilationError(f"the linear solver cannot be loaded: {error}") from error
        return library.path, library.cached

    return _attempt(LINEAR_SOLVER, build, None, cache_dir)


def _attempt(
    part: str,
    build: Callable[[Path], tuple[Built, bool]],
    otherwise: Built,
    cache_dir: Path | None,
) -> tuple[Built, BuildReport]:
    """What is built, and whether it came from the cache; or what there is without a compiler."""
    begin, missing = time.perf_counter(), frozenset({part})
    if cache_dir is None:
        return otherwise, BuildReport(missing, False, 0.0, "no cache folder was given")
    try:
        built, cached = build(cache_dir)
    except (CompilationError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        return otherwise, BuildReport(missing, False, time.perf_counter() - begin, reason)
    return built, BuildReport(frozenset(), cached, time.perf_counter() - begin, "")


def _generated(functions: list[ca.Function]) -> str:
    generator = ca.CodeGenerator("expert.c")
    for function in functions:
        generator.add(function)
    return str(generator.dump())
