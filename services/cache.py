"""The cache of this machine's user: what can be made again at any time, shared by all homes."""

import os
import tempfile
from pathlib import Path

VARIABLE = "LMTR_CACHE"
"""Environment variable that names the cache's folder."""


def machine_cache(chosen: Path | None = None) -> Path:
    """Absolute folder of the cache; whoever fills it makes it.

    It is the chosen one, else that of ``LMTR_CACHE``, else ``lmtr`` in the user's folder of caches
    (``XDG_CACHE_HOME``, ``~/.cache``), else, where nothing can be made there, a folder by the
    user's number among the temporary ones. The first two are taken as they are: who names a folder
    wants to hear that it does not serve.
    """
    named = chosen or os.environ.get(VARIABLE)
    if named:
        return Path(os.path.abspath(Path(named).expanduser()))
    usual = _user_caches() / "lmtr"
    if _can_be_filled(usual):
        return usual
    return Path(tempfile.gettempdir()) / f"lmtr-{os.geteuid()}"


def _user_caches() -> Path:
    named = os.environ.get("XDG_CACHE_HOME", "")
    # The standard asks to ignore what is not absolute; an unknown ~ stays as it is.
    return Path(named if os.path.isabs(named) else os.path.expanduser("~/.cache"))


def _can_be_filled(folder: Path) -> bool:
    if not folder.is_absolute():
        return False
    present = next(place for place in (folder, *folder.parents) if place.exists())
    return present.is_dir() and os.access(present, os.W_OK | os.X_OK)
