"""Where a lake lies: a folder of this machine, or a prefix of an object store."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote

from services.errors import LakeError

REMOTE = "s3://"


@dataclass(frozen=True)
class Storage:
    """The place of all tables of a lake.

    Attributes:
        root: Absolute path of a folder, or ``s3://bucket/prefix``; without a slash at its end.
        options: What delta-rs needs to reach an object store; empty for a folder.
    """

    root: str
    options: Mapping[str, str] = field(default_factory=dict, repr=False)

    @classmethod
    def at(cls, place: "Path | str | Storage") -> "Storage":
        """The storage at a path or address.

        Raises:
            LakeError: delta-rs would look in another place.
        """
        if isinstance(place, Storage):
            return place
        text = str(place)
        if not text.startswith(REMOTE):
            text = os.path.abspath(text)
        # delta-rs takes %XX in a path for an escape and then looks in another folder.
        if unquote(text) != text:
            raise LakeError(
                f"lake {text}: its path must hold no '%' before two hexadecimal digits; "
                "choose another folder"
            )
        return cls(text.rstrip("/"))

    @property
    def is_remote(self) -> bool:
        """Whether it is an object store."""
        return self.root.startswith(REMOTE)

    @property
    def folder(self) -> Path:
        """The folder of a lake on this machine.

        Raises:
            LakeError: It is in an object store.
        """
        if self.is_remote:
            raise LakeError(f"lake {self.root}: it has no folder on this machine; use a local home")
        return Path(self.root)

    def table(self, name: str) -> str:
        """Path or address of a table."""
        return f"{self.root}/{name}"
