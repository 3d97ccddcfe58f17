"""What a cluster's first start makes: secrets that only its owner reads, and who that is.

Everything that is there already stays as it is. A secret is made anew by removing its file and
starting the cluster again.
"""

import os
import secrets
import zlib
from contextlib import suppress
from pathlib import Path

IMAGE_USER = 10001
"""The images' own user, whom containers run as where they are started by root."""

MADE = ("ray_token", "postgres_password", "storage_password")
"""Secrets of 256 bits, in hexadecimal."""

STORAGE = "storage.env"
"""Secret with the variables of an object store, for a home in one; empty without."""

OWN_STORE = "http://storage:9000"
"""Where nodes reach the cluster's own object storage."""


def container_user() -> int:
    """Number of the user that the containers run as, but where the engine maps users.

    Whoever starts them, also by `sudo`, so that secrets can be closed to all others; never root.
    """
    return os.getuid() or int(os.environ.get("SUDO_UID") or 0) or IMAGE_USER


def make_secrets(folder: Path, user: int, mode: int = 0o600) -> None:
    """Make the secrets that are missing: closed files in a folder of mode 0700.

    Args:
        folder: Where they lie.
        user: Number of the containers' user; where root makes them, they are that user's.
        mode: Of the files.
    """
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    _make(folder / ".gitignore", "*\n")
    for name in MADE:
        _make(folder / name, secrets.token_hex(32) + "\n")
    _make(folder / STORAGE, "")
    files = [folder / name for name in (*MADE, STORAGE)]
    for place in (folder, *files):
        if os.getuid() == 0:  # only the containers' user, and root, may read them
            os.chown(place, user, -1)
        place.chmod(0o700 if place == folder else mode)


def secrets_state(folder: Path) -> str:
    """Another word as soon as a secret's file has been written again.

    Containers carry it as a label, so that Compose replaces those which know older secrets. It
    tells of times alone, nothing of what the files hold.
    """
    times = [(folder / name).stat().st_mtime_ns for name in (*MADE, STORAGE)]
    return f"{zlib.crc32(repr(times).encode()):08x}"


def use_storage(folder: Path, wanted: bool) -> None:
    """Name the cluster's own object storage, or no longer; a store of the user's own stays."""
    place = folder / STORAGE
    named = place.read_text(encoding="ascii").strip()
    if named and f"AWS_ENDPOINT_URL={OWN_STORE}\n" not in f"{named}\n":
        return
    password = (folder / "storage_password").read_text(encoding="ascii").strip()
    own = (
        f"AWS_ENDPOINT_URL={OWN_STORE}\nAWS_REGION=us-east-1\n"
        f"AWS_ACCESS_KEY_ID=lmtr\nAWS_SECRET_ACCESS_KEY={password}"
    )
    text = own if wanted else ""
    if text != named:
        place.write_text(f"{text}\n" if text else "", encoding="ascii")


def _make(place: Path, content: str) -> None:
    """Never readable by others, not even for a moment; two starts at once agree on one."""
    partial = place.with_name(f".{place.name}.{os.getpid()}")
    descriptor = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w", encoding="ascii") as file:
        file.write(content)
    with suppress(FileExistsError):
        os.link(partial, place)
    partial.unlink()
