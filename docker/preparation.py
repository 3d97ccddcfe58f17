"""What a cluster's first start makes: secrets that only its owner reads, and who that is.

Everything that is there already stays as it is. A secret is made anew by removing its file and
starting the cluster again.
"""

import os
import secrets
from pathlib import Path

IMAGE_USER = 10001
"""The images' own user, whom containers run as where they are started by root."""

MADE = ("ray_token", "postgres_password", "storage_password")
"""Secrets of 256 bits, in hexadecimal."""

STORAGE = "storage.env"
"""Secret with the variables of an object store, for a home in one; empty without."""


def container_user(*, rootless: bool = False) -> int:
    """Number of the user that the containers run as.

    Whoever starts them, so that the secrets' files can be closed to all others, but never root.

    Args:
        rootless: The engine runs as that user too, who is called root in its containers.
    """
    return 0 if rootless else os.getuid() or IMAGE_USER


def make_secrets(folder: Path, user: int) -> list[str]:
    """Make the secrets that are missing: files of mode 0600 in a folder of mode 0700.

    Args:
        folder: Where they lie.
        user: Number of the containers' user; where root makes them, they are that user's.

    Returns:
        The names of those that were made.
    """
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder.chmod(0o700)
    missing = [name for name in MADE if not (folder / name).exists()]
    for name in MADE:
        _make(folder / name, secrets.token_hex(32) + "\n")
    _make(folder / STORAGE, "")
    if os.getuid() == 0:  # only the containers' user, and root, may read them
        for name in (*MADE, STORAGE):
            os.chown(folder / name, user, -1)
    return missing


def use_storage(folder: Path) -> None:
    """Name the cluster's own object storage, unless another one is named already."""
    place = folder / STORAGE
    if place.read_text(encoding="ascii").strip():
        return
    password = (folder / "storage_password").read_text(encoding="ascii").strip()
    place.write_text(
        "AWS_ENDPOINT_URL=http://storage:9000\nAWS_REGION=us-east-1\n"
        f"AWS_ACCESS_KEY_ID=lmtr\nAWS_SECRET_ACCESS_KEY={password}\n",
        encoding="ascii",
    )


def _make(place: Path, content: str) -> None:
    """Never readable by others, not even for a moment; two starts at once agree on one."""
    partial = place.with_name(f".{place.name}.{os.getpid()}")
    descriptor = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w", encoding="ascii") as file:
        file.write(content)
    try:
        os.link(partial, place)
    except FileExistsError:
        place.chmod(0o600)
    finally:
        partial.unlink()
