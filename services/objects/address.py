"""Addresses ``s3://bucket/prefix``: told apart from folders, checked before anything is asked."""

import re
from dataclasses import dataclass
from pathlib import Path

from services.errors import StoreError

SCHEME = "s3://"

BUCKET = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{1,61}[A-Za-z0-9]")

SEGMENT = re.compile(r"[A-Za-z0-9!_.*'()=-]+")
"""Characters that every store, URL and log takes as they are."""


@dataclass(frozen=True)
class Address:
    """A place in an object store.

    Attributes:
        bucket: Name of the bucket.
        prefix: What the keys of all objects there begin with, without slashes at its ends; may be
            empty.
    """

    bucket: str
    prefix: str

    @classmethod
    def parse(cls, text: str) -> "Address":
        """The address that a text gives; slashes at its end do not matter.

        Raises:
            StoreError: It is none.
        """
        bucket, _, prefix = text.removeprefix(SCHEME).partition("/")
        prefix = prefix.strip("/")
        if not text.startswith(SCHEME) or not BUCKET.fullmatch(bucket):
            raise StoreError(
                f"address {text!r}: must be {SCHEME}BUCKET/PREFIX with a bucket's name of 3 to 63 "
                "letters, digits, dots and dashes; correct it"
            )
        for segment in prefix.split("/") if prefix else ():
            if not SEGMENT.fullmatch(segment) or set(segment) == {"."}:
                raise StoreError(
                    f"address {text!r}: the part {segment!r} must be made of letters, digits and "
                    "- _ . = ! * ' ( ); choose another prefix"
                )
        return cls(bucket, prefix)

    def __truediv__(self, part: str) -> "Address":
        """The address of a part below this one."""
        return Address(self.bucket, f"{self.prefix}/{part}" if self.prefix else part)

    def __str__(self) -> str:
        return f"{SCHEME}{self.bucket}" + (f"/{self.prefix}" if self.prefix else "")


def is_address(place: Path | str) -> bool:
    """Whether a place is in an object store, and no folder.

    Raises:
        StoreError: It looks like an address, and would be taken for a folder of a strange name.
    """
    text = str(place)
    if text.startswith(SCHEME):
        return True
    kind = re.match(r"([A-Za-z][A-Za-z0-9+.-]+):/", text)
    if kind:
        raise StoreError(
            f"address {text!r}: must be a folder or begin with {SCHEME} (as text: a Path loses a "
            "slash); correct it"
        )
    return False
