"""What runs in a worker process: a worker made on first use, exceptions turned into replies."""

import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from services.cluster.cluster import Failure, Outcome
from services.cluster.sweep import Done, Report, SweepStoppedError

T = TypeVar("T")
R = TypeVar("R")
C = TypeVar("C")
D = TypeVar("D")

SINGLE_THREADED = dict.fromkeys(
    (
        "OMP_NUM_THREADS",
        "MKL_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "NUMEXPR_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
    ),
    "1",
)
"""Environment of a worker process: one worker a core, one thread each. Torch obeys OMP's."""


@dataclass(frozen=True)
class Reply(Generic[R]):
    """What a worker sends back; the item itself stays with the driver."""

    result: R | None = None
    error: str | None = None
    traceback: str = ""

    def about(self, item: T) -> Outcome[T, R]:
        """The outcome of ``item`` that this reply means."""
        failure = None if self.error is None else Failure.EXCEPTION
        return Outcome(item, self.result, self.error, failure, self.traceback)


class Workplace(Generic[T, R]):
    """Holds one worker and makes it when the first item comes.

    A worker that cannot be made fails each item with its reason, instead of taking the process
    with it.
    """

    def __init__(self, make_worker: Callable[[], Callable[[T], R]]) -> None:
        self._make_worker = make_worker
        self._worker: Callable[[T], R] | None = None

    def run(self, item: T) -> Reply[R]:
        """Work on one item."""
        try:
            if self._worker is None:
                self._worker = self._make_worker()
            return Reply(self._worker(item))
        except Exception as error:
            return Reply(error=described(error), traceback=traceback.format_exc())


def described(error: BaseException) -> str:
    """Kind and message of an exception in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}".removesuffix(": ")


def attempted(
    trainable: Callable[[C, D, Report], R], config: C, data: D, report: Report
) -> Done[R]:
    """Run one trial; what it raises becomes its error."""
    began, clock = time.time(), time.monotonic()
    try:
        result = trainable(config, data, report)
    except SweepStoppedError:
        raise
    except Exception as error:
        return Done(error=described(error), traceback=traceback.format_exc(), began=began)
    return Done(result, began=began, seconds=time.monotonic() - clock)
