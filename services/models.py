"""Folders of trained models: on this machine, and for a home in an object store there as well."""

import hashlib
import json
import tempfile
from pathlib import Path
from typing import Any

from services.errors import HomeError, StoreError
from services.files import is_file_name
from services.home import Home
from services.objects.store import ObjectStore

WHOLE = "whole.json"
"""Object that lists a model's files with their digests; written last, so what has it is whole."""


class ModelStore:
    """The models of a home, a folder of files each.

    In an object store a model is the objects ``models/ID/FILE`` and the list of them. Where a home
    is a folder, that folder is all there is.
    """

    def __init__(self, home: Home) -> None:
        self._home = home

    def folder(self, model_id: str) -> Path:
        """Folder of a model on this machine, whether it is there or not.

        Raises:
            HomeError: Its id, which may come from a table that others wrote, is the name of none.
        """
        if not is_file_name(model_id):
            raise HomeError(
                f"home {self._home.name}: no model can be called {model_id!r}; use no home whose "
                "tables say so"
            )
        return self._home.models / model_id

    def publish(self, model_id: str) -> None:
        """Put a model that was just saved where other machines find it.

        Raises:
            StoreError: The object store cannot be written to.
        """
        store = self._store
        if store is None:
            return
        files = {path.name: path.read_bytes() for path in sorted(self.folder(model_id).iterdir())}
        for name, content in files.items():
            store.put(_key(model_id, name), content)
        digests = {name: _digest(content) for name, content in files.items()}
        store.put(_key(model_id, WHOLE), json.dumps({"sha256": digests}, indent=1).encode())

    def fetched(self, model_id: str) -> Path:
        """Folder of a model on this machine, filled from the object store where it is missing.

        Nothing is made for a model that is not whole in the store either.

        Raises:
            StoreError: The object store cannot be read, or the model is damaged there.
        """
        folder, store = self.folder(model_id), self._store
        if store is None or folder.exists():
            return folder
        listed = store.get(_key(model_id, WHOLE))
        if listed is not None:
            folder.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(prefix=f".{model_id}-", dir=folder.parent) as scratch:
                draft = Path(scratch, "new")
                draft.mkdir()
                for name, digest in _listed(store, model_id, listed).items():
                    (draft / name).write_bytes(_whole(store, model_id, name, digest))
                if not folder.exists():  # another process may have been quicker
                    draft.rename(folder)
        return folder

    @property
    def _store(self) -> ObjectStore | None:
        return None if self._home.access is None else ObjectStore(self._home.access)


def _listed(store: ObjectStore, model_id: str, content: bytes) -> dict[str, str]:
    """Digests by file names; a name must stay in the model's folder."""
    try:
        digests: Any = json.loads(content)["sha256"]
        if not all(map(is_file_name, digests)):
            raise ValueError("it names what is no file of the model")
        return {name: str(digest) for name, digest in digests.items()}
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise _damaged(store, model_id, WHOLE) from error


def _whole(store: ObjectStore, model_id: str, name: str, digest: str) -> bytes:
    content = store.get(_key(model_id, name))
    if content is None or _digest(content) != digest:
        raise _damaged(store, model_id, name)
    return content


def _damaged(store: ObjectStore, model_id: str, name: str) -> StoreError:
    return StoreError(
        f"model {model_id!r} in {store.access.address}: {name} is missing or damaged there; "
        "run `lmtr train` again where the model was trained, or delete it there"
    )


def _key(model_id: str, name: str) -> str:
    return f"models/{model_id}/{name}"


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
