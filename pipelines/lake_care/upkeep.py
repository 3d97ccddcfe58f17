"""``lmtr lake compact``, ``vacuum`` and ``migrate``: what keeps a lake quick, small and current."""

from collections.abc import Sequence
from datetime import timedelta

from lmtr.errors import ConfigurationError
from pipelines.lake_care.rendering import said, size
from pipelines.lake_care.tables import chosen
from pipelines.workspace import Workspace
from services.lake import maintenance
from services.lake.exclusive import lock_of
from services.lake.inspection import data_files
from services.lake.migration import migrate as migrate_table
from services.lake.migration import outdated
from services.lake.schemas import SCHEMAS, version_of


def compact(workspace: Workspace, tables: Sequence[str] = ()) -> None:
    """Join small files; every version stays readable."""
    lake = workspace.lake
    for name in chosen(tables, lake.tables()):
        before = len(data_files(lake.delta(name)))
        if not lake.compact(name):
            said(f"{name}: left alone, another process is at it ({lock_of(lake.storage, name)})")
            continue
        after = len(data_files(lake.delta(name)))
        said(f"{name}: {before} files, now {after}")


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
    """
    if forget_history and not (confirmed or dry_run):
        raise ConfigurationError(
            "vacuum: old versions cannot be read again after --forget-history; add --yes if that "
            "is meant, or --dry-run to see what would go"
        )
    lake = workspace.lake
    find = maintenance.forgotten if forget_history else maintenance.orphans
    for name in chosen(tables, lake.tables()):
        unneeded = find(lake, name, grace)
        if not dry_run:
            maintenance.remove(lake, name, unneeded)
        freed = size(sum(each.nbytes for each in unneeded))
        said(f"{name}: {len(unneeded)} files, {freed}, {'would go' if dry_run else 'deleted'}")
        if dry_run:
            for each in unneeded:
                said(f"    {each.path}")


def migrate(workspace: Workspace, tables: Sequence[str] = ()) -> None:
    """Bring tables up to this LMTR's schema versions."""
    lake = workspace.lake
    for name in chosen(tables, lake.tables()):
        found, known = outdated(lake, name), version_of(SCHEMAS[name])
        if found is None:
            migrate_table(lake, name)  # refuses a newer one
            said(f"{name}: is of schema version {known} already")
            continue
        added = migrate_table(lake, name)
        said(f"{name}: schema version {found} → {known}; new columns: {', '.join(added) or 'none'}")
