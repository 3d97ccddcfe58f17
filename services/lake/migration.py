"""Tables of an older schema version, brought up to this one; their data files stay as they are.

A version only ever added columns that may be null, so the table's metadata is all that changes.
Columns come first and the version last: a migration that was killed is an old table with new
columns, and the next one goes on from there.
"""

from contextlib import suppress

import pyarrow as pa
from deltalake import CommitProperties, DeltaTable, Schema
from deltalake.exceptions import CommitFailedError, DeltaError

from services.errors import LakeError
from services.lake.delta import CONFLICT_RETRIES, VERSION_KEY
from services.lake.schemas import ADDED, SCHEMAS, older_versions, version_of
from services.lake.tables import Lake


def outdated(lake: Lake, table: str) -> str | None:
    """The schema version of a table that has to be migrated, else None."""
    found = _version(lake.opened(table))
    return found if found in older_versions(table) else None


def migrate(lake: Lake, table: str) -> list[str]:
    """Bring a table up to this LMTR's schema version; does nothing to one that is.

    Two at once do not harm each other: the one that is slower begins anew and finds it done.

    Returns:
        The columns that were added; a killed migration may have left none to add.

    Raises:
        LakeError: The table is of a newer version, or cannot be read or written.
    """
    added: list[str] = []
    for _ in range(CONFLICT_RETRIES):
        delta = lake.opened(table)
        if _version(delta) not in older_versions(table):
            lake.delta(table)  # refuses what is neither older nor this version
            return added
        # delta-rs says "already exists" to the slower one of two that add the same column.
        with suppress(CommitFailedError, DeltaError):
            added += _step(table, delta)
            lake.settle(table, delta)
    raise LakeError(
        f"table {table!r}: {CONFLICT_RETRIES} tries to migrate it failed; stop other writers, see "
        "whether the disk is full or read-only, and run `lmtr lake migrate` again"
    )


def _step(table: str, delta: DeltaTable) -> list[str]:
    found, known = _version(delta), version_of(SCHEMAS[table])
    present = {field.name for field in delta.schema().fields}
    missing = [
        name
        for version, names in sorted(ADDED[table].items())
        if version > int(found or 0)
        for name in names
        if name not in present
    ]
    note = CommitProperties(custom_metadata={"lmtr.migration": f"{found} to {known}"})
    if missing:
        fields = pa.schema([SCHEMAS[table].field(name).remove_metadata() for name in missing])
        delta.alter.add_columns(Schema.from_arrow(fields).fields, commit_properties=note)
    delta.alter.set_table_properties({VERSION_KEY: known}, False, commit_properties=note)
    return missing


def _version(delta: DeltaTable) -> str | None:
    return delta.metadata().configuration.get(VERSION_KEY)
