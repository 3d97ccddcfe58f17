"""The marker ``home.json``: what a home is known by, wherever it lies.

It is written before anything else, so that a place of somebody else's is never taken for a home and
never written to.
"""

import json
from typing import Any

from services.errors import HomeError

MARKER = "home.json"

VERSION = 1
"""Version of the layout below a home; a home of a newer one is not touched."""

APPLICATION = "lmtr"

CONTENT = json.dumps({"application": APPLICATION, "version": VERSION}) + "\n"


def require_known(home: str, marker: bytes) -> None:
    """Refuse a home of somebody else's, or of a newer LMTR.

    Args:
        home: What people call it.
        marker: Content of its marker.

    Raises:
        HomeError: It is one.
    """
    try:
        content: Any = json.loads(marker)
    except ValueError:
        content = None
    if not isinstance(content, dict) or content.get("application") != APPLICATION:
        raise HomeError(
            f"home {home}: its {MARKER} is not LMTR's; choose another folder with --home"
        )
    version = content.get("version")
    if not isinstance(version, int) or version > VERSION:
        raise HomeError(
            f"home {home} is of version {version}, this LMTR knows versions up to "
            f"{VERSION}; update LMTR, or choose another folder with --home"
        )


def require_unclaimed(home: str, foreign: list[str], *, create: bool) -> None:
    """Refuse a place without a marker that holds other things, or where none is to be made.

    Args:
        home: What people call it.
        foreign: Names of what is there.
        create: Whether a home is to be made.

    Raises:
        HomeError: It does, or none is.
    """
    if foreign:
        raise HomeError(
            f"home {home}: it holds other things ({foreign[0]!r}, …) and no "
            f"{MARKER}; choose an empty or a new folder (or prefix) with --home"
        )
    if not create:
        raise HomeError(f"there is no LMTR home at {home}; make one with `lmtr run demo`")
