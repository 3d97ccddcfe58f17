"""The cache of compiled experts, looked at without importing the expert, which takes long."""

import tempfile
from pathlib import Path

from lmtr.errors import CompilationError
from lmtr.expert.shared_library import require_private
from services.cache import VARIABLE


def compiled_sizes(cache: Path) -> list[int]:
    """Bytes of each compiled expert in a cache, whatever it is for."""
    return [entry.stat().st_size for entry in cache.glob("*.so")]


def cache_fault(cache: Path) -> str:
    """Why nothing can be compiled into this cache, and what to do about it; empty if it can."""
    try:
        require_private(cache)
        with tempfile.TemporaryFile(dir=cache) as file:
            file.write(b"?")
    except CompilationError as error:
        return str(error)
    except OSError as error:
        return (
            f"cache {cache} cannot be used ({error.strerror or error}); name a folder of your own "
            f"in {VARIABLE} or cluster.cache, or make room"
        )
    return ""
