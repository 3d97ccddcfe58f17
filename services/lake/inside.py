"""Files of a table in a folder lie in that folder: neither its log nor a link may lead elsewhere.

A lake may come from others. What is outside of it is the user's own, and is not to be read because
an entry of a log says ``../../…``, or because a link stands where a file should.
"""

import os
from collections.abc import Iterable
from pathlib import Path
from urllib.parse import unquote

from deltalake import DeltaTable

from services.errors import LakeError


def paths_of(delta: DeltaTable) -> tuple[str, ...]:
    """Absolute paths of an opened table's files, which delta-rs names by URIs of its own."""
    return tuple(unquote(uri.removeprefix("file://")) for uri in delta.file_uris())


def require_inside(table: str, folder: Path, paths: Iterable[str]) -> None:
    """Refuse a table of which a file lies elsewhere; the table's own folder may be a link.

    Args:
        table: Its name.
        folder: Its folder.
        paths: Its files.

    Raises:
        LakeError: One lies outside, or is a link.
    """
    # delta-rs names a folder behind a link by either of its names.
    roots = (os.path.realpath(folder), str(folder))
    known = set(roots)
    for path in paths:
        above = os.path.dirname(path)
        if above not in known and any(_leads_inside(root, above) for root in roots):
            known.add(above)
        if above not in known or os.path.islink(path):
            raise LakeError(
                f"table {table!r} cannot be read: its file {path!r} lies outside of it or is a "
                "link; put the file itself into its place, or use a lake that you trust"
            )


def _leads_inside(root: str, folder: str) -> bool:
    """Whether a folder is below another one, without a link or ``..`` between them."""
    if not folder.startswith(f"{root}/"):
        return False
    return os.path.realpath(folder) == os.path.realpath(root) + folder.removeprefix(root)
