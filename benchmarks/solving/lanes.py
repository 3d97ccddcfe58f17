"""Processes that solve, side by side, and the tasks dealt out to them.

A lane is one worker for each expert that is compared. They take turns, task by task, so that
whatever else the machine does falls on all of them alike, and every other time the second expert
goes first. With one lane, one core works at a time.
"""

import json
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from benchmarks.solving import worker
from benchmarks.solving.worker import Reply
from lmtr.errors import LmtrError
from lmtr.task.sampling import Noise
from lmtr.task.task import Task

HERE = Path(__file__).resolve().parent.parent.parent
"""The checkout that this benchmark belongs to."""

ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}

Lane = Sequence["Worker"]


class BenchmarkError(LmtrError):
    """The benchmark cannot go on."""


@dataclass(frozen=True)
class Contender:
    """An expert to be measured.

    Attributes:
        checkout: Folder of the project's code that solves.
        source: Its configuration: built-in name, path, or None for its defaults.
        overrides: Its settings that differ from that, ``section.key=value``.
    """

    checkout: Path
    source: str | None
    overrides: tuple[str, ...]


class Worker:
    """A running worker process; ``setup`` is its first reply."""

    def __init__(self, contender: Contender, cache: Path) -> None:
        self._checkout = contender.checkout.resolve()
        choice = {
            "checkout": str(self._checkout),
            "source": contender.source,
            "overrides": contender.overrides,
            "cache": str(cache.resolve()),
        }
        self._process = subprocess.Popen(
            # -P: modules beside the script must not hide any of the checkout's.
            [sys.executable, "-P", worker.__file__, json.dumps(choice)],
            env={**os.environ, **ONE_THREAD, "PYTHONPATH": str(self._checkout)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        try:
            self.setup = self._reply()
        except BaseException:
            self.close()
            raise

    def solve(self, task: Task, noise: Noise) -> Reply:
        """The worker's reply for one task.

        Raises:
            BenchmarkError: It failed outside the solver, or ended.
        """
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):  # then there will be no reply either
            pickle.dump({"task": asdict(task), "noise": asdict(noise)}, self._process.stdin)
            self._process.stdin.flush()
        return self._reply()

    def stop(self) -> None:
        """End the process; a thread that waits for its reply is told so by an error."""
        self._process.kill()

    def close(self) -> None:
        """End the process and let go of it; no thread may wait for it any more."""
        self.stop()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            with suppress(BrokenPipeError):
                pipe.close()

    def _reply(self) -> Reply:
        assert self._process.stdout is not None
        try:
            reply: dict[str, Any] = pickle.load(self._process.stdout)
        except EOFError:
            code = self._process.wait()
            raise BenchmarkError(
                f"benchmark: the worker of {self._checkout} ended with code {code}; its last "
                "words stand above"
            ) from None
        if "error" in reply:
            raise BenchmarkError(f"benchmark: the expert of {self._checkout}: {reply['error']}")
        return reply


@contextmanager
def open_lanes(contenders: Sequence[Contender], count: int, cache: Path) -> Iterator[list[Lane]]:
    """``count`` lanes of one worker per contender; the first worker of each compiles for all."""
    with ExitStack() as stack:
        lanes: list[Lane] = []
        for _ in range(count):
            lane = []
            for contender in contenders:
                lane.append(Worker(contender, cache))
                stack.callback(lane[-1].close)
            lanes.append(lane)
        yield lanes


def solve_all(
    lanes: Sequence[Lane], tasks: Sequence[tuple[Task, Noise]], done: Callable[[], None]
) -> list[list[Reply]]:
    """Replies of every contender for every task.

    Args:
        lanes: Open lanes.
        tasks: Tasks with their noise.
        done: Called when all contenders have solved a task.
    """
    idle: SimpleQueue[Lane] = SimpleQueue()
    for lane in lanes:
        for solver in lane:
            solver.solve(*tasks[0])  # a first solve loads libraries and touches memory
        idle.put(lane)

    def solve(index: int) -> list[Reply]:
        lane = idle.get()
        turns = range(len(lane)) if index % 2 == 0 else reversed(range(len(lane)))
        try:
            replies = {turn: lane[turn].solve(*tasks[index]) for turn in turns}
        finally:
            idle.put(lane)
        done()
        return [replies[turn] for turn in range(len(lane))]

    with ThreadPoolExecutor(len(lanes)) as threads:
        futures = [threads.submit(solve, index) for index in range(len(tasks))]
        try:
            return [future.result() for future in futures]
        except BaseException:
            threads.shutdown(wait=False, cancel_futures=True)
            for lane in lanes:
                for solver in lane:
                    solver.stop()
            raise
