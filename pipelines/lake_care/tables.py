"""Which tables a command of care means."""

from collections.abc import Sequence

from services.errors import LakeError
from services.lake.schemas import SCHEMAS


def chosen(wanted: Sequence[str], found: Sequence[str]) -> list[str]:
    """The tables that were named, else all that were found.

    Raises:
        LakeError: No table has that name, or it is not there.
    """
    for name in wanted:
        if name not in SCHEMAS:
            raise LakeError(f"lake: no table is called {name!r}; choose of {', '.join(SCHEMAS)}")
        if name not in found:
            there = ", ".join(found) or "none"
            raise LakeError(f"lake: table {name!r} is not there yet; there are: {there}")
    return list(wanted) or list(found)
