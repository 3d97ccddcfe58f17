"""What keeps a growing table quick to read; whatever hinders it costs no rows and ends no work."""

import logging

from services.lake.exclusive import holder_of, lock_of
from services.lake.tables import Lake

logger = logging.getLogger(__name__)


def join_files(lake: Lake, table: str) -> None:
    """Join the small files of a table, or say on the log why that was not done.

    Raises nothing: the rows are kept already, and reading is slower at worst. That another process
    on this disk is at it is not worth a word; a lock in an object store may have been left behind.
    """
    try:
        if lake.compact(table) or not lake.storage.is_remote:
            return
        holder = holder_of(lake.storage, table)
    except Exception as error:
        logger.warning(
            "small files were not joined, no row is lost by that: %s; see what is damaged with "
            "`lmtr lake check`",
            error,
        )
        return
    logger.warning(
        "small files were not joined, no row is lost by that: %s holds %s; if it does not run any "
        "more, delete that object, then run `lmtr lake compact`",
        holder or "another process",
        lock_of(lake.storage, table),
    )
