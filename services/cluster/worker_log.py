"""Warnings of workers on the driver's log, once each and then by count."""

import logging
import re
import time
from collections import Counter

TELL_AGAIN_S = 60.0
"""Repetitions of a message are told together, at most so often (s)."""

MOST_KINDS = 100
"""So many kinds of messages are told apart in a run; all further ones are counted as one."""

VARYING = re.compile(
    r"0x[0-9a-f]+"  # addresses
    r"|(?<![0-9a-z])[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}(?![0-9a-z])"  # UUIDs
    r"|(?<![0-9a-z])(?=[a-f]*\d)[0-9a-f]{8,}(?![0-9a-z])"  # hexadecimal ids
    r"|\d+",
    re.IGNORECASE,
)
"""What differs in messages of one kind."""

logger = logging.getLogger("workers")


class WorkerLog:
    """Takes what workers logged; messages that differ in numbers and ids alone count as one."""

    def __init__(self) -> None:
        self._told: set[str] = set()
        self._repeated: Counter[str] = Counter()
        self._others = 0
        self._is_full = False
        self._since = time.monotonic()

    def tell(self, lines: tuple[str, ...]) -> None:
        """Log what is new, and count the rest."""
        for line in lines:
            self._take(line)
        if time.monotonic() - self._since > TELL_AGAIN_S:
            self.close()

    def close(self) -> None:
        """Tell what was repeated."""
        for kind, count in self._repeated.items():
            logger.warning("workers said %d times more: %s", count, kind)
        if self._others:
            logger.warning("workers gave %d warnings of further kinds", self._others)
        self._repeated.clear()
        self._others = 0
        self._since = time.monotonic()

    def _take(self, line: str) -> None:
        kind = VARYING.sub("#", line)
        if kind in self._told:
            self._repeated[kind] += 1
        elif len(self._told) < MOST_KINDS:
            self._told.add(kind)
            logger.warning("a worker says: %s", line)
        else:
            self._others += 1
            if not self._is_full:
                self._is_full = True
                logger.warning(
                    "workers gave %d kinds of warnings; further kinds are only counted", MOST_KINDS
                )
