"""Waiting for what containers take their time for."""

import time
import urllib.error
from collections.abc import Callable
from contextlib import suppress

PATIENCE_S = 400.0
"""No job may take longer, whatever befalls it."""


def await_true(condition: Callable[[], bool], what: str, patience_s: float = PATIENCE_S) -> None:
    """Return when something has become true."""
    until = time.monotonic() + patience_s
    while not _holds(condition):
        assert time.monotonic() < until, f"no {what} after {patience_s:.0f} s"
        time.sleep(0.5)


def _holds(condition: Callable[[], bool]) -> bool:
    """A head that is away for a moment says no."""
    with suppress(OSError, urllib.error.URLError):
        return condition()
    return False
