"""Files that appear under their name only when they are whole."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from services.errors import OutputError


def is_file_name(text: str) -> bool:
    """Whether a text names something in a folder, and leads nowhere else."""
    return text not in ("", ".", "..") and not {"/", "\\", "\0"} & set(text)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a path to write to, which takes the place of ``path`` when the block ends well.

    Folders are made as needed. After an error nothing is left, and what stood at ``path`` stays. A
    link is followed: the file that it leads to is replaced.

    Raises:
        OutputError: The file cannot be written, the disk being full included, or something that is
            no regular file has its name.
    """
    path = path.resolve()
    if path.exists() and not path.is_file():
        raise OutputError(f"{path} exists and is no regular file; name another file")
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield partial
        os.replace(partial, path)
    except OSError as error:
        raise OutputError(
            f"{path} cannot be written ({error.strerror or error}); name another file or make room"
        ) from error
    finally:
        if partial.is_file():
            partial.unlink()
