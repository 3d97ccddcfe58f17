"""Single objects of a store: read, made only where there is none, replaced, listed."""

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta

from obstore.exceptions import AlreadyExistsError, BaseError
from obstore.store import S3Store

from services.errors import StoreError
from services.objects.access import Access
from services.objects.faults import Fault, fault, plain

CONNECT = timedelta(seconds=5)
REQUEST = timedelta(seconds=20)
RETRIES = 2
RETRY = timedelta(seconds=10)
"""People wait for these requests: a store that does not answer is given up after seconds."""

LISTED = 50


class ObjectStore:
    """The objects below one address.

    Attributes:
        access: The address, and how it is reached.
    """

    def __init__(self, access: Access) -> None:
        self.access = access
        self._store = S3Store(
            access.address.bucket,
            prefix=access.address.prefix or None,
            config=access.settings,  # type: ignore[arg-type]  # its keys are typed one by one
            client_options={
                "allow_http": access.allows_http,
                "connect_timeout": CONNECT,
                "timeout": REQUEST,
            },
            retry_config={"max_retries": RETRIES, "retry_timeout": RETRY},
        )

    def get(self, key: str) -> bytes | None:
        """Content of an object; None if there is none."""
        with self._explained("read"):
            try:
                return bytes(self._store.get(key).bytes())
            except FileNotFoundError as error:
                if fault(error) is not None:  # it is the bucket that is missing
                    raise
                return None

    def put(self, key: str, content: bytes) -> None:
        """Write an object, in the place of an older one."""
        with self._explained("written to"):
            self._store.put(key, content)

    def put_new(self, key: str, content: bytes) -> bool:
        """Write an object where there is none; returns whether there was none.

        Only as good as the store's conditional writes, see ``probe``.
        """
        with self._explained("written to"):
            try:
                self._store.put(key, content, mode="create")
            except AlreadyExistsError:
                return False
        return True

    def delete(self, key: str) -> None:
        """Remove an object, if it is there."""
        with self._explained("written to"):
            self._store.delete(key)

    def first_keys(self) -> list[str]:
        """Keys of the first few objects, in their order."""
        with self._explained("listed"):
            chunk = next(iter(self._store.list(chunk_size=LISTED)), [])
        return [entry["path"] for entry in chunk]

    @contextmanager
    def _explained(self, done: str) -> Iterator[None]:
        try:
            yield
        except (BaseError, OSError) as error:
            known = fault(error) or Fault(plain(error), "check the store and the address")
            raise StoreError(
                f"object store {self.access} cannot be {done}: {known.cause}; {known.mend}"
            ) from error
