"""Does a store keep two writers apart? Asked of the store itself, before anything is trusted to it.

A commit to a table is an object that must not be there yet. A store that takes ``If-None-Match: *``
and writes nevertheless would let two writers overwrite one another's commits, without a word.
"""

import functools
import statistics
import time

from services.errors import StoreError
from services.objects.access import Access
from services.objects.store import ObjectStore

KEY = "conditional-writes"
"""Object that the probe tries to make again and again; it stays, so no permission to delete."""

CONTENT = b"LMTR asks here whether the store refuses to write an object that exists.\n"

ROUNDS = 5


@functools.cache
def require_conditional_writes(access: Access) -> None:
    """Refuse a store that would overwrite what is to be written only if it is not there.

    Asked once in each process for each address.

    Raises:
        StoreError: It would, or it cannot be reached or written to.
    """
    store = ObjectStore(access)
    # One of them may find none; whatever others do at once, the second must find one.
    store.put_new(KEY, CONTENT)
    if store.put_new(KEY, CONTENT):
        raise StoreError(
            f"object store {access}: it overwrites an object although asked not to "
            "(If-None-Match: *), so two writers would overwrite one another's commits; use a store "
            "that honours conditional writes (docs/object-storage.md)"
        )


def round_trip_seconds(access: Access) -> float:
    """Median time of reading one small object.

    Raises:
        StoreError: The store cannot be read.
    """
    store = ObjectStore(access)
    store.get(KEY)  # the first request also connects
    times = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        store.get(KEY)
        times.append(time.perf_counter() - start)
    return statistics.median(times)
