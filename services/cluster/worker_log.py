"""Warnings of workers on the driver's log, once each and then by count."""

import logging
import re
import time
from collections import Counter

TELL_AGAIN_S = 60.0
"""Repetitions of a message are told together, at most so often (s)."""

logger = logging.getLogger("workers")


class WorkerLog:
    """Takes what workers logged; messages that differ in their numbers alone count as one."""

    def __init__(self) -> None:
        self._told: set[str] = set()
        self._repeated: Counter[str] = Counter()
        self._since = time.monotonic()

    def tell(self, lines: tuple[str, ...]) -> None:
        """Log what is new, and count the rest."""
        for line in lines:
            kind = re.sub(r"\d+", "#", line)
            if kind in self._told:
                self._repeated[line if kind == line else kind] += 1
            else:
                self._told.add(kind)
                logger.warning("a worker says: %s", line)
        if time.monotonic() - self._since > TELL_AGAIN_S:
            self.close()

    def close(self) -> None:
        """Tell what was repeated."""
        for kind, count in self._repeated.items():
            logger.warning("workers said %d times more: %s", count, kind)
        self._repeated.clear()
        self._since = time.monotonic()
