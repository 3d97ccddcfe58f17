"""The home: the one place that holds everything LMTR makes, a folder or a prefix of a store."""

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from services.companion import companion_folder, make_companion
from services.errors import HomeError
from services.locks import LockHeldError, Locks
from services.marker import CONTENT, MARKER, require_known, require_unclaimed
from services.objects import probe
from services.objects.access import Access
from services.objects.address import Address, is_address
from services.objects.store import ObjectStore

LAKE = "lake"
"""Name of the lakehouse's folder, or the last part of its address."""

TRACKER_VARIABLE = "MLFLOW_TRACKING_URI"
"""Environment variable that names a tracker which the machines of a home in an object store share.

A home in a folder has its own, whatever a user's other work with MLflow has set there.
"""

CLUSTER_TRACKER_VARIABLE = "LMTR_TRACKING"
"""Environment variable that names the tracker of all homes, set on the machines of a cluster."""


@dataclass(frozen=True)
class Home:
    """An open home; all paths lie below ``root``.

    Attributes:
        root: Absolute path of the folder; of a home in an object store, its companion folder on
            this machine.
        access: The address of a home in an object store, and how it is reached; None of a folder.
        shared_tracker: URI of the tracker that the home shares with others; empty for its own.
    """

    root: Path
    access: Access | None = None
    shared_tracker: str = ""

    @classmethod
    def open(cls, place: Path | str, *, create: bool) -> "Home":
        """Open the home at ``place``.

        Args:
            place: Its folder, absolute or relative to the working directory, or its address
                ``s3://bucket/prefix``, as text.
            create: Make a home where the folder is missing or empty, and require that it can be
                written; otherwise it only has to be readable.

        Raises:
            HomeError: There is no home, it cannot be used, or the folder is somebody else's.
            StoreError: The object store cannot be reached or is not safe for two writers.
        """
        if is_address(place):
            return cls._open_remote(Address.parse(str(place)), create)
        root = Path(os.path.abspath(Path(place).expanduser()))
        home = cls(root, shared_tracker=shared_tracker(place))
        try:
            home._claim(create)
        except OSError as error:
            reason = error.strerror or str(error)
            raise HomeError(
                f"home {home.root} cannot be opened: {reason}; choose another folder with --home"
            ) from error
        return home

    @property
    def name(self) -> str:
        """What people call it: its folder or its address."""
        return str(self.root if self.access is None else self.access.address)

    @property
    def lake(self) -> Path | str:
        """Folder or address of the lakehouse's tables."""
        return self.root / LAKE if self.access is None else f"{self.access.address}/{LAKE}"

    @property
    def tracking_db(self) -> Path:
        """SQLite file of the experiment tracker."""
        return self.root / "mlflow.db"

    @property
    def tracking_uri(self) -> str:
        """Address of the experiment tracker, as MLflow writes it."""
        return self.shared_tracker or f"sqlite:///{self.tracking_db}"

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

    @property
    def locks(self) -> Locks:
        """Locks by which processes of this machine keep out of each other's way."""
        return Locks(self.root / "locks")

    @contextmanager
    def lock(self, name: str, *, shared: bool = False) -> Iterator[None]:
        """Be the only process of this machine that does ``name`` in this home.

        Args:
            name: What is done.
            shared: Let others do it as well; those who do it alone are still kept out.

        Raises:
            HomeError: Another process is doing it.
        """
        try:
            with self.locks.held(name, shared=shared):
                yield
        except LockHeldError as error:
            raise HomeError(
                f"home {self.name}: {error.holder} is busy with {name!r}; wait until it is done, "
                "or stop it"
            ) from error

    def require_writable(self) -> None:
        """Refuse a home that nothing can be written to, before any work is done.

        Raises:
            HomeError: It is read-only, or the disk is full.
            StoreError: The object store refuses writes, or is not safe for two writers.
        """
        if self.access is not None:
            probe.require_conditional_writes(lake_access(self.access))
        try:
            with tempfile.TemporaryFile(dir=self.root) as file:
                file.write(b"?")
        except OSError as error:
            raise HomeError(
                f"home {self.root} cannot be written to ({error.strerror}); mend its permissions, "
                "make room, or name another --home"
            ) from error

    @classmethod
    def _open_remote(cls, address: Address, create: bool) -> "Home":
        access = Access.from_environment(address)
        _claim_remote(ObjectStore(access), create)
        folder = companion_folder(access)
        make_companion(folder)
        return cls(folder, access, shared_tracker(str(address)))

    def _claim(self, create: bool) -> None:
        """Check the marker, or set it on a folder that is missing or empty."""
        if self.root.exists() and not self.root.is_dir():
            raise HomeError(f"home {self.root} is a file, not a folder; choose another with --home")
        if create:
            self.root.mkdir(parents=True, exist_ok=True)
        marker = self.root / MARKER
        if not marker.exists():
            there = self.root.iterdir() if self.root.exists() else ()
            present = sorted(entry.name for entry in there)
            # A marker that another process is just writing is no foreign file.
            foreign = [name for name in present if not name.startswith(f".{MARKER}.")]
            require_unclaimed(self.name, foreign, create=create)
            self._mark()
        require_known(self.name, marker.read_bytes())
        needed = os.R_OK | os.X_OK | (os.W_OK if create else 0)
        if not os.access(self.root, needed):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(self.root))

    def _mark(self) -> None:
        partial = self.root / f".{MARKER}.{os.getpid()}"
        partial.write_text(CONTENT, encoding="ascii")
        os.replace(partial, self.root / MARKER)


def shared_tracker(place: Path | str) -> str:
    """URI of the tracker that a home at this folder or address would share; empty for its own."""
    named = os.environ.get(CLUSTER_TRACKER_VARIABLE, "")
    return named or (os.environ.get(TRACKER_VARIABLE, "") if is_address(place) else "")


def _claim_remote(store: ObjectStore, create: bool) -> None:
    """Check the marker in a store, or set it where there is nothing else."""
    name, marker = str(store.access.address), store.get(MARKER)
    if marker is None:
        # Another process may just be making this home: what it writes is not foreign.
        keys = store.first_keys()
        marker = store.get(MARKER) if MARKER in keys else None
        if marker is None:
            foreign = [key for key in keys if key != f"{LAKE}/{probe.KEY}"]
            require_unclaimed(name, foreign, create=create)
    if create:
        probe.require_conditional_writes(lake_access(store.access))
    if marker is None:
        store.put_new(MARKER, CONTENT.encode())
        marker = store.get(MARKER)
    require_known(name, marker or b"")


def lake_access(access: Access) -> Access:
    """The access to the lake of a home: commits to it are what must be safe."""
    return replace(access, address=access.address / LAKE)
