"""The home folder: the one place on a disk that holds everything LMTR makes.

A home is known by its marker ``home.json``, written before anything else, so that a folder of
somebody else's is never taken for one and never written to.
"""

import errno
import fcntl
import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from services.errors import HomeError

MARKER = "home.json"

VERSION = 1
"""Version of the layout below a home; a home of a newer one is not touched."""

APPLICATION = "lmtr"


@dataclass(frozen=True)
class Home:
    """An open home; all paths lie below ``root``.

    Attributes:
        root: Absolute path of the folder.
    """

    root: Path

    @classmethod
    def open(cls, root: Path, *, create: bool) -> "Home":
        """Open the home at ``root``.

        Args:
            root: Its folder, absolute or relative to the working directory.
            create: Make a home where the folder is missing or empty, and require that it can be
                written; otherwise it only has to be readable.

        Raises:
            HomeError: There is no home, it cannot be used, or the folder is somebody else's.
        """
        home = cls(Path(os.path.abspath(root.expanduser())))
        try:
            home._claim(create)
        except OSError as error:
            reason = error.strerror or str(error)
            raise HomeError(
                f"home {home.root} cannot be opened: {reason}; choose another folder with --home"
            ) from error
        return home

    @property
    def lake(self) -> Path:
        """Folder of the lakehouse's tables."""
        return self.root / "lake"

    @property
    def tracking_db(self) -> Path:
        """SQLite file of the experiment tracker."""
        return self.root / "mlflow.db"

    @property
    def artifacts(self) -> Path:
        """Folder of the files that tracked runs keep."""
        return self.root / "artifacts"

    @property
    def models(self) -> Path:
        """Folder of trained models, one folder each."""
        return self.root / "models"

    @property
    def reports(self) -> Path:
        """Folder of reports and pictures."""
        return self.root / "reports"

    @contextmanager
    def lock(self, name: str) -> Iterator[None]:
        """Be the only process of this machine that does ``name`` in this home.

        The kernel releases the lock when its holder ends, however it ends.

        Raises:
            HomeError: Another process is doing it.
        """
        folder = self.root / "locks"
        folder.mkdir(exist_ok=True)
        with (folder / f"{name}.lock").open("a+", encoding="ascii") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                file.seek(0)
                raise HomeError(
                    f"home {self.root}: process {file.read() or '?'} is busy with {name!r}; "
                    "wait until it is done, or stop it"
                ) from error
            file.truncate(0)
            file.write(str(os.getpid()))
            file.flush()
            yield

    def require_writable(self) -> None:
        """Refuse a home that nothing can be written to, before any work is done.

        Raises:
            HomeError: It is read-only, or the disk is full.
        """
        try:
            with tempfile.TemporaryFile(dir=self.root) as file:
                file.write(b"?")
        except OSError as error:
            raise HomeError(
                f"home {self.root} cannot be written to ({error.strerror}); mend its permissions, "
                "make room, or name another --home"
            ) from error

    def _claim(self, create: bool) -> None:
        """Check the marker, or set it on a folder that is missing or empty."""
        if self.root.exists() and not self.root.is_dir():
            raise HomeError(f"home {self.root} is a file, not a folder; choose another with --home")
        if create:
            self.root.mkdir(parents=True, exist_ok=True)
        marker = self.root / MARKER
        if not marker.exists():
            self._require_unclaimed(create)
            self._mark()
        self._require_known(marker)
        needed = os.R_OK | os.X_OK | (os.W_OK if create else 0)
        if not os.access(self.root, needed):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(self.root))

    def _require_unclaimed(self, create: bool) -> None:
        present = sorted(entry.name for entry in self.root.iterdir()) if self.root.exists() else []
        # A marker that another process is just writing is no foreign file.
        foreign = [name for name in present if not name.startswith(f".{MARKER}.")]
        if foreign:
            raise HomeError(
                f"home {self.root}: the folder holds other things ({foreign[0]!r}, …) and no "
                f"{MARKER}; choose an empty or a new folder with --home"
            )
        if not create:
            raise HomeError(f"there is no LMTR home at {self.root}; make one with `lmtr run demo`")

    def _mark(self) -> None:
        content = {"application": APPLICATION, "version": VERSION}
        partial = self.root / f".{MARKER}.{os.getpid()}"
        partial.write_text(json.dumps(content) + "\n", encoding="ascii")
        os.replace(partial, self.root / MARKER)

    def _require_known(self, marker: Path) -> None:
        try:
            content: Any = json.loads(marker.read_text(encoding="utf-8"))
        except ValueError:
            content = None
        if not isinstance(content, dict) or content.get("application") != APPLICATION:
            raise HomeError(
                f"home {self.root}: its {MARKER} is not LMTR's; choose another folder with --home"
            )
        version = content.get("version")
        if not isinstance(version, int) or version > VERSION:
            raise HomeError(
                f"home {self.root} is of version {version}, this LMTR knows versions up to "
                f"{VERSION}; update LMTR, or choose another folder with --home"
            )
