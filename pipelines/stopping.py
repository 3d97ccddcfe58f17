"""Ctrl-C and SIGTERM as a wish: the first lets work under way be finished and kept."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from pipelines.progress import say

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Stop:
    """Whether the user has asked to stop; call it to know.

    Args:
        fate: What becomes of what is under way, for people.
    """

    def __init__(self, fate: str = "what is under way is finished and kept") -> None:
        self._asked = False
        self._fate = fate

    def __call__(self) -> bool:
        """Whether the user has asked to stop."""
        return self._asked

    def listen(self) -> None:
        """Take the signals from now on; outside the main thread nothing can ask."""
        if threading.current_thread() is threading.main_thread():
            for number in SIGNALS:
                signal.signal(number, self.ask)

    def ask(self, _signal: int, _frame: FrameType | None) -> None:
        """Take the signal; the second one stops at once."""
        if self._asked:
            raise KeyboardInterrupt
        self._asked = True
        say(f"stopping: {self._fate} (once more to stop at once)")


@contextmanager
def stop_on_signals(stop: Stop | None = None) -> Iterator[Stop]:
    """Take the signals inside the block; elsewhere than in the main thread nothing can ask."""
    stop = stop or Stop()
    before = {number: signal.getsignal(number) for number in SIGNALS}
    stop.listen()
    try:
        yield stop
    finally:
        if threading.current_thread() is threading.main_thread():
            for number, handler in before.items():
                signal.signal(number, handler)
