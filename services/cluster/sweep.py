"""Sweeps: trials that train something each, and report while they do.

A trial is a name and a configuration; what it makes comes to the driver when it is done, and only
the driver keeps it.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from services.errors import ClusterError

C = TypeVar("C")
D = TypeVar("D")
R = TypeVar("R")

Report = Callable[[Mapping[str, float]], None]
"""What a trial tells of itself while it runs."""

REPORT_EVERY_S = 1.0
"""A trial is heard at most so often (s): it waits for the driver each time."""

TRIALS_ON_A_GPU = 8
"""Most trials that share a GPU; each holds some 0.5 GB of its memory before it has any data."""


@dataclass(frozen=True)
class Trial(Generic[C]):
    """One training of a sweep.

    Attributes:
        name: What people call it, no two alike in a sweep.
        config: What is trained; travels by pickle.
    """

    name: str
    config: C


@dataclass(frozen=True)
class Done(Generic[R]):
    """What came of a trial.

    Attributes:
        result: What it made; None if it failed.
        error: What went wrong, in one line; None if nothing did.
        traceback: Where, for people.
        began: When it began, on its host's clock (s since 1970).
        seconds: How long it took (s).
    """

    result: R | None = None
    error: str | None = None
    traceback: str = ""
    began: float = 0.0
    seconds: float = 0.0


@dataclass(frozen=True)
class Sweep(Generic[C, D, R]):
    """Trials, and who hears of them.

    Attributes:
        trainable: ``(config, data, report) -> result``; a function that pickle knows by name, or a
            partial one.
        trials: What to train.
        data: Shared by all trials; lies once in the memory of each host.
        on_report: Hears what running trials tell.
        on_done: Hears of each trial that ends, in the driver's thread; what it raises ends the
            sweep.
        stopping: Whether to give up what is under way and begin no more.
        device: ``cpu``, ``cuda`` (GPUs or nothing) or ``auto`` (GPUs where there are any).
    """

    trainable: Callable[[C, D, Report], R]
    trials: Sequence[Trial[C]]
    data: D
    on_report: Callable[[Trial[C], Mapping[str, float]], None]
    on_done: Callable[[Trial[C], Done[R]], None]
    stopping: Callable[[], bool] = lambda: False
    device: str = "auto"


class SweepStoppedError(Exception):
    """Raised out of a report in a trial that is to be given up."""


def gpu_share(device: str, gpus: float, slots: int) -> float:
    """The share of a GPU that each trial takes, so that all slots are busy where that can be.

    Args:
        device: As in :class:`Sweep`.
        gpus: GPUs of the cluster.
        slots: Trials at once.

    Raises:
        ClusterError: GPUs are asked for and there is none.
    """
    if device == "cpu":
        return 0.0
    if gpus <= 0:
        if device == "cuda":
            raise ClusterError(
                "cluster: device 'cuda' is asked for and the cluster has no GPU; use "
                "training.optimizer.device 'auto' or 'cpu', or a cluster that has one"
            )
        return 0.0
    each = -(-slots // int(max(gpus, 1)))  # trials on the GPU that has most
    return 1.0 / min(max(each, 1), TRIALS_ON_A_GPU)


class Seldom:
    """Passes on a report now and then, the first one always."""

    def __init__(self, report: Report, every_s: float = REPORT_EVERY_S) -> None:
        self._report, self._every_s, self._last = report, every_s, -float("inf")

    def __call__(self, metrics: Mapping[str, float]) -> None:
        """Report, unless one went out a moment ago."""
        now = time.monotonic()
        if now - self._last >= self._every_s:
            self._last = now
            self._report(metrics)
