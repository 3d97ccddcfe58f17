"""``lmtr lake check`` and ``repair``: whether a lake is whole, and what makes it so."""

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import asdict

from pipelines.lake_care.references import (
    Progress,
    layout_findings,
    progress_of,
    reference_findings,
)
from pipelines.lake_care.rendering import counted, print_json, print_records, said
from pipelines.lake_care.tables import chosen
from pipelines.progress import bar, say
from pipelines.turns import REPAIR, alone, at_work, told
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
from services.lake.schemas import MADE_BY, SCHEMAS
from services.lake.tables import Lake
from services.locks import Holder


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
    busy = at_work(workspace.home)
    with bar("Looking at rows", _expected_rows(lake, names)) as progress:
        inspections = [inspect_table(lake, name, most, progress.advance) for name in names]
    known = [each for each in inspections if each.is_known]
    if not tables:  # one that is gone altogether holds no rows
        known += [Inspection(name) for name in SCHEMAS if name not in names]
    rows = {each.table: readable_rows(lake, each) for each in known}
    findings = [finding for each in inspections for finding in each.findings]
    if "datasets" in rows:
        findings += layout_findings(rows["datasets"])
    findings += reference_findings(rows, most)
    busy += [each for each in at_work(workspace.home) if each not in busy]
    _report(inspections, findings, progress_of(rows), busy, form)
    return not findings


def repair(workspace: Workspace, tables: Sequence[str] = (), *, dry_run: bool = False) -> None:
    """Make damaged tables usable, and print what was done and what was lost.

    Raises:
        LakeError: A table cannot be repaired; the others were.
        HomeError: Another process of this machine changes the home.
    """
    _warn(at_work(workspace.home) if dry_run else ())
    if workspace.home.access is not None:
        say("repair: it cannot see what other machines write to the store; see that none does")
    with nullcontext() if dry_run else alone(workspace.home, REPAIR):
        names = chosen(tables, tables_found(workspace.lake))
        failed = [name for name in names if not _repaired(workspace.lake, name, dry_run)]
    if failed:
        raise LakeError(f"lake: {', '.join(failed)} not repaired, for the reasons above")


def _repaired(lake: Lake, table: str, dry_run: bool) -> bool:
    """Repair one table and tell of it; returns whether that could be done."""
    try:
        lines = _told(repair_table(lake, table, dry_run=dry_run), dry_run)
    except LakeError as error:
        said(f"{table}: {error}")
        return False
    for line in lines:
        said(f"{table}: {line}")
    return True


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
    busy: Sequence[Holder],
    form: str,
) -> None:
    _warn(busy)
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
                "at_work": [asdict(holder) for holder in busy],
            }
        )
        return
    print_records(looked, form)
    if progress:
        print_records([asdict(each) for each in progress], form)
    for finding in findings:
        times = "once" if finding.count == 1 else f"{finding.count} times"
        said(f"✗ {finding.table}, {finding.kind}: fails {times}: {finding.says}")
        for subject in finding.subjects:
            said(f"    {subject}")
        if finding.count > len(finding.subjects):
            said(f"    … and {finding.count - len(finding.subjects)} more")
        said(f"  mend: {finding.mend}")
    if not findings:
        said("✓ nothing is wrong")


def _warn(busy: Sequence[Holder]) -> None:
    """Say that what is found may be of rows that are just being made."""
    if busy:
        say(
            f"at work now: {' and '.join(map(told, busy))}; rows are on their way, so what is "
            "found may be of this moment only: look again when that is done"
        )


def _told(done: Repair, dry_run: bool) -> list[str]:
    """What a repair did or would do, one line each."""
    if not done.changed:
        return ["nothing to repair"]
    verb = "would go" if dry_run else "went"
    lines = [f"{path} {verb} to {QUARANTINE}/" for path in done.log_files]
    if done.version is not None:
        lines.append(
            f"its log is whole up to version {done.version}"
            if done.version >= 0
            else "no version of its log is whole: it is made anew from its files"
        )
    if dry_run and done.log_files:
        lines.append("its data files can be judged only when its log is mended")
    if done.lost_until is not None and done.lost_until > (done.version or 0):
        lines.append(f"versions from there to {done.lost_until} are lost, and their numbers too")
    lines += [f"{path} {verb} to {QUARANTINE}/: it {why}" for path, why in done.files.items()]
    lines += [f"{path} is gone, {_rows_of(rows)}" for path, rows in done.missing.items()]
    if dry_run:
        if done.files:
            rows = counted(done.taken_out, "row")
            lines.append(f"of {rows} in files to be moved, the whole ones would be added again")
        return lines
    lines.append(f"{counted(done.salvaged, 'row')} salvaged, {done.lost} lost")
    if done.refused:
        lines.append(f"{counted(done.refused, 'damaged row')} left out")
    if done.recut:
        rows = counted(done.recut, "more row")
        lines.append(f"{rows} taken out: others that are made together with them are lost")
    if done.lost or done.recut or done.refused or done.log_files:
        lines.append(f"`{MADE_BY[done.table]}` makes what is missing again, with the same numbers")
    return lines


def _rows_of(rows: int | None) -> str:
    return "with rows that nobody counted" if rows is None else f"with {counted(rows, 'row')}"
