"""Where a lake lies: a folder of this machine, or a prefix of an object store."""

import os
import re
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from services.errors import LakeError
from services.objects.access import Access
from services.objects.address import Address, is_address
from services.objects.probe import require_conditional_writes

_UNFIT = re.compile(r"[\[\]^|\\\x00-\x1f\x7f\ud800-\udfff]")
"""Characters of a path that delta-rs panics at ([ ] ^ |) or cannot write (the others)."""


@dataclass(frozen=True)
class Storage:
    """The place of all tables of a lake.

    Attributes:
        root: Absolute path of a folder, or ``s3://bucket/prefix``; without a slash at its end.
        access: How an object store is reached; None for a folder.
    """

    root: str
    access: Access | None = None

    @classmethod
    def at(cls, place: "Path | str | Storage") -> "Storage":
        """The storage at a path or address; how a store is reached is read from the environment.

        Raises:
            LakeError: delta-rs would look in another place, or cannot work there.
            StoreError: The address or the environment is wrong.
        """
        if isinstance(place, Storage):
            return place
        if is_address(place):
            address = Address.parse(str(place))
            return cls(str(address), Access.from_environment(address))
        text = os.path.abspath(place)
        # delta-rs takes %XX in a path for an escape and then looks in another folder.
        if unquote(text) != text:
            raise LakeError(
                f"lake {text}: its path must hold no '%' before two hexadecimal digits; "
                "choose another folder"
            )
        if unfit := _UNFIT.search(text):
            raise LakeError(
                f"lake {text!r}: its path must hold no {unfit[0]!r}, as no table can be kept "
                "there (nor with one of [ ] ^ | \\ or a control character); choose another folder"
            )
        return cls(text.rstrip("/"))

    @property
    def is_remote(self) -> bool:
        """Whether it is an object store."""
        return self.access is not None

    @property
    def options(self) -> dict[str, str]:
        """What delta-rs needs to reach an object store; empty for a folder."""
        return {} if self.access is None else self.access.lake_options

    def require_safe_commits(self) -> None:
        """Refuse an object store in which two writers would overwrite one another's commits.

        Raises:
            StoreError: It is one, or it cannot be reached or written to.
        """
        if self.access is not None:
            require_conditional_writes(self.access)

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
