"""``lmtr lake compact``, ``vacuum`` and ``migrate``: what keeps a lake quick, small and current."""

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from datetime import timedelta

from lmtr.errors import ConfigurationError
from pipelines.lake_care.rendering import counted, said, size
from pipelines.lake_care.tables import chosen
from pipelines.turns import (
    COMPACTION,
    MIGRATION,
    VACUUM,
    VACUUM_ALONE,
    alone,
    beside_others,
    require_no_stage,
)
from pipelines.workspace import Workspace
from services.lake import maintenance
from services.lake.exclusive import lock_of
from services.lake.inspection import data_files
from services.lake.migration import migrate as migrate_table
from services.lake.migration import outdated
from services.lake.schemas import SCHEMAS, version_of
from services.lake.tables import Lake


def compact(workspace: Workspace, tables: Sequence[str] = ()) -> None:
    """Join small files, beside whoever appends; every version stays readable.

    Raises:
        LakeError: A table cannot be read or written.
        HomeError: A repair is at work.
    """
    with beside_others(workspace.home, COMPACTION, shared=True):
        for name in chosen(tables, workspace.lake.tables()):
            said(f"{name}: {_joined(workspace.lake, name)}")


def _joined(lake: Lake, table: str) -> str:
    before = len(data_files(lake.delta(table)))
    if not lake.compact(table):
        return f"left alone, another process is at it ({lock_of(lake.storage, table)})"
    return f"{counted(before, 'file')}, now {len(data_files(lake.delta(table)))}"


def vacuum(
    workspace: Workspace,
    tables: Sequence[str],
    grace: timedelta,
    *,
    forget_history: bool,
    confirmed: bool,
    dry_run: bool,
) -> None:
    """Delete files that nothing refers to; with ``forget_history`` those of old versions too.

    Raises:
        ConfigurationError: History is to be forgotten and nobody said yes.
        LakeError: A log is damaged.
        HomeError: Another process changes the home, see :func:`_turn_to_delete`.
    """
    if forget_history and not (confirmed or dry_run):
        raise ConfigurationError(
            "vacuum: old versions cannot be read again after --forget-history; add --yes if that "
            "is meant, or --dry-run to see what would go"
        )
    with _turn_to_delete(workspace, grace, forget_history, dry_run):
        lake = workspace.lake
        find = maintenance.forgotten if forget_history else maintenance.orphans
        for name in chosen(tables, lake.tables()):
            unneeded = find(lake, name, grace)
            if not dry_run:
                maintenance.remove(lake, name, unneeded)
            _tell_deleted(name, unneeded, dry_run)


def _turn_to_delete(
    workspace: Workspace, grace: timedelta, forget_history: bool, dry_run: bool
) -> AbstractContextManager[None]:
    """The lock that a deletion needs.

    Files old enough that nobody may be about to commit them can go beside whoever appends. Younger
    ones cannot, nor old versions: a training that is at work reads one that no model names yet.
    """
    if dry_run:
        return nullcontext()
    if forget_history or grace < maintenance.GRACE:
        return alone(workspace.home, VACUUM_ALONE)
    return beside_others(workspace.home, VACUUM, shared=True)


def _tell_deleted(table: str, unneeded: Sequence[maintenance.Unneeded], dry_run: bool) -> None:
    freed = size(sum(each.nbytes for each in unneeded))
    verb = "would go" if dry_run else "deleted"
    said(f"{table}: {counted(len(unneeded), 'file')}, {freed}, {verb}")
    if dry_run:
        for each in unneeded:
            said(f"    {each.path}")


def migrate(workspace: Workspace, tables: Sequence[str] = ()) -> None:
    """Bring tables up to this LMTR's schema versions.

    Raises:
        LakeError: A table is of a newer version, or cannot be read or written.
        HomeError: A table is older and a stage of the older LMTR may be at work on it, or a repair.
    """
    with beside_others(workspace.home, MIGRATION, shared=True):
        lake = workspace.lake
        names = chosen(tables, lake.tables())
        if any(outdated(lake, name) is not None for name in names):
            # The older LMTR cannot append to a table that has become newer than it.
            require_no_stage(workspace.home, MIGRATION)
        for name in names:
            said(f"{name}: {_brought_up(lake, name)}")


def _brought_up(lake: Lake, table: str) -> str:
    found, known = outdated(lake, table), version_of(SCHEMAS[table])
    added = migrate_table(lake, table)  # refuses a newer one
    if found is None:
        return f"is of schema version {known} already"
    return f"schema version {found} → {known}; new columns: {', '.join(added) or 'none'}"
