"""The companion folder of a home in an object store: what needs a file system lies on this machine.

That is the tracker's database, the files of its runs, reports, locks, and copies of models. All of
it is for this machine alone, and nothing in it is needed to go on with a data set elsewhere.
"""

import hashlib
import os
import re
from collections.abc import Mapping
from pathlib import Path

from services.errors import HomeError
from services.objects.access import Access

VARIABLE = "LMTR_STATE"
"""Environment variable that names the folder of all companion folders."""

DIGEST_SIZE = 8

READABLE = 60


def companion_folder(access: Access, environment: Mapping[str, str] | None = None) -> Path:
    """Absolute path of the companion folder of the home at an address; nothing is made.

    It is named after the address, with a digest of the address and the store's endpoint, below
    ``LMTR_STATE``, else ``lmtr`` in the user's folder of states (``XDG_STATE_HOME``,
    ``~/.local/state``).

    Args:
        access: The home's address, and how it is reached.
        environment: The variables; those of this process by default.
    """
    given = os.environ if environment is None else environment
    named = given.get(VARIABLE)
    if named:
        states = Path(os.path.abspath(Path(named).expanduser()))
    else:
        standard = given.get("XDG_STATE_HOME", "")
        # The standard asks to ignore what is not absolute.
        usual = standard if os.path.isabs(standard) else os.path.expanduser("~/.local/state")
        states = Path(usual) / "lmtr"
    identity = f"{access.endpoint or ''} {access.address}".encode()
    digest = hashlib.blake2b(identity, digest_size=DIGEST_SIZE).hexdigest()
    readable = re.sub(r"[^A-Za-z0-9.]+", "-", str(access.address).removeprefix("s3://"))
    return states / f"{readable[-READABLE:].strip('-.')}-{digest}"


def make_companion(folder: Path) -> None:
    """Make the folder if need be.

    Raises:
        HomeError: It cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise HomeError(
            f"companion folder {folder} cannot be made: {error.strerror or error}; name another "
            f"place with {VARIABLE}"
        ) from error
