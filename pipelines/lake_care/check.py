"""``lmtr lake check`` and ``repair``: whether a lake is whole, and what makes it so."""

from collections.abc import Sequence
from dataclasses import asdict

from pipelines.lake_care.references import (
    Progress,
    layout_findings,
    progress_of,
    reference_findings,
)
from pipelines.lake_care.rendering import print_json, print_records, said
from pipelines.lake_care.tables import chosen
from pipelines.progress import bar
from pipelines.workspace import Workspace
from services.errors import LakeError
from services.lake.inspection import (
    SHOWN,
    Finding,
    Inspection,
    data_files,
    inspect_table,
    readable_rows,
    tables_found,
)
from services.lake.repair import QUARANTINE, Repair, repair_table
from services.lake.schemas import MADE_BY
from services.lake.tables import Lake


def check(
    workspace: Workspace, tables: Sequence[str] = (), most: int = SHOWN, form: str = "table"
) -> bool:
    """Look over a lake and print what is wrong with it; returns whether nothing is.

    Args:
        workspace: Its home.
        tables: Which tables; all that are there by default, and what they say of each other.
        most: Rows that are named of all that break the same thing.
        form: ``table`` or ``json``.

    Raises:
        LakeError: A table has another name.
    """
    lake = workspace.lake
    names = chosen(tables, tables_found(lake))
    with bar("Looking at rows", _expected_rows(lake, names)) as progress:
        inspections = [inspect_table(lake, name, most, progress.advance) for name in names]
    rows = {each.table: readable_rows(lake, each) for each in inspections if each.readable}
    findings = [finding for each in inspections for finding in each.findings]
    if "datasets" in rows:
        findings += layout_findings(rows["datasets"])
    findings += reference_findings(rows, most)
    _report(inspections, findings, progress_of(rows), form)
    return not findings


def repair(workspace: Workspace, tables: Sequence[str] = (), *, dry_run: bool = False) -> None:
    """Make damaged tables usable, and print what was done and what was lost.

    Raises:
        LakeError: A table cannot be repaired.
        HomeError: Another repair is at work.
    """
    lake = workspace.lake
    with workspace.home.lock("lake-repair"):
        for name in chosen(tables, tables_found(lake)):
            done = repair_table(lake, name, dry_run=dry_run)
            for line in _told(done, dry_run):
                said(f"{name}: {line}")


def _expected_rows(lake: Lake, names: Sequence[str]) -> int | None:
    """Rows that the log promises; None where it cannot be read."""
    try:
        files = [file for name in names for file in data_files(lake.delta(name))]
    except LakeError:
        return None
    return sum(file.rows or 0 for file in files)


def _report(
    inspections: Sequence[Inspection],
    findings: Sequence[Finding],
    progress: Sequence[Progress],
    form: str,
) -> None:
    looked = [
        {
            "table": each.table,
            "rows": each.rows,
            "files": len(each.readable),
            "damaged files": len(each.damaged) + len(each.missing),
            "made before schema version 2": each.undigested,
            "findings": sum(finding.table == each.table for finding in findings),
        }
        for each in inspections
    ]
    if form == "json":
        print_json(
            {
                "clean": not findings,
                "tables": looked,
                "data_sets": [asdict(each) for each in progress],
                "findings": [asdict(finding) for finding in findings],
            }
        )
        return
    print_records(looked, form)
    if progress:
        print_records([asdict(each) for each in progress], form)
    for finding in findings:
        said(f"✗ {finding.table}, {finding.kind}: not so {finding.count} times: {finding.says}")
        for subject in finding.subjects:
            said(f"    {subject}")
        if finding.count > len(finding.subjects):
            said(f"    … and {finding.count - len(finding.subjects)} more")
        said(f"  mend: {finding.mend}")
    if not findings:
        said("✓ nothing is wrong")


def _told(done: Repair, dry_run: bool) -> list[str]:
    """What a repair did, one line each."""
    if not done.changed:
        return ["nothing to repair"]
    verb = "would go" if dry_run else "went"
    lines = [f"{path} {verb} to {QUARANTINE}/" for path in done.log_files]
    if done.version is not None:
        lines.append(
            f"whole up to version {done.version}"
            if done.version >= 0
            else "no version of its log is whole: it is made anew from its files"
        )
    if done.lost_until is not None and done.lost_until > (done.version or 0):
        lines.append(f"versions from there to {done.lost_until} are lost, and their numbers too")
    lines += [f"{path} {verb} to {QUARANTINE}/: it {why}" for path, why in done.files.items()]
    lines += [f"{path} was gone, with {rows} rows" for path, rows in done.missing.items()]
    if dry_run:
        return lines
    lines.append(f"{done.salvaged} rows salvaged, {done.lost} lost, {done.refused} damaged ones")
    if done.recut:
        lines.append(
            f"{done.recut} more rows taken out: others that are made together with them are lost"
        )
    if done.lost or done.recut or done.refused or done.log_files:
        lines.append(f"`{MADE_BY[done.table]}` makes what is missing again, with the same numbers")
    return lines
