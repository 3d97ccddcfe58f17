"""The secret that lets a client into a cluster: where it is found, and never shown."""

import os
import re
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from services.errors import ClusterRefusedError

VALUE_VARIABLE = "RAY_AUTH_TOKEN"
FILE_VARIABLE = "RAY_AUTH_TOKEN_PATH"

LIMIT = 4096
"""What is longer is no token."""

WORD = re.compile(rf"[!-~]{{1,{LIMIT}}}")


@dataclass(frozen=True)
class Token:
    """A token and where it came from.

    Attributes:
        value: The secret; left out of what is printed of this object.
        source: Where it was found, for people.
        file: The file that it was read from, if it was.
    """

    value: str = field(repr=False)
    source: str
    file: Path | None = None

    @classmethod
    def read(cls, file: Path) -> "Token":
        """The token in a file.

        Raises:
            ClusterRefusedError: The file cannot be read, or holds no token.
        """
        try:
            with file.open(encoding="ascii") as opened:
                value = opened.read(LIMIT + 1).strip()
            written = time.strftime("%Y-%m-%d %H:%M", time.localtime(file.stat().st_mtime))
        except (OSError, UnicodeDecodeError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it is no text"
            raise ClusterRefusedError(
                f"token file {file} cannot be read ({reason}); mend its path or its permissions, "
                "or copy the token from the cluster's head"
            ) from error
        return cls._checked(value, f"{file} (written {written})", file)

    @classmethod
    def find(
        cls, file: Path | None = None, environment: Mapping[str, str] | None = None
    ) -> "Token | None":
        """The token of a file, else of ``RAY_AUTH_TOKEN``, else of ``RAY_AUTH_TOKEN_PATH``.

        Args:
            file: The file that the user names.
            environment: The variables; those of this process by default.

        Returns:
            The token, or None where none is named: some clusters want none.

        Raises:
            ClusterRefusedError: A file is named that cannot be read, or holds no token.
        """
        given = os.environ if environment is None else environment
        if file is not None:
            return cls.read(file)
        if given.get(VALUE_VARIABLE):
            return cls._checked(given[VALUE_VARIABLE].strip(), f"the variable {VALUE_VARIABLE}")
        if given.get(FILE_VARIABLE):
            return cls.read(Path(given[FILE_VARIABLE]).expanduser())
        return None

    @classmethod
    def _checked(cls, value: str, source: str, file: Path | None = None) -> "Token":
        if not WORD.fullmatch(value):
            raise ClusterRefusedError(
                f"token from {source}: it is none, which is one word of at most {LIMIT} letters "
                "and digits; copy it from the cluster's head"
            )
        return cls(value, source, file)
