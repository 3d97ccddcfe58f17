"""``lmtr lake info``, ``history``, ``stats`` and ``sample``: what a lake holds."""

from collections.abc import Sequence
from operator import itemgetter

import numpy as np

from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT, Field, Layout
from pipelines.lake_care.rendering import cell, print_records, said, size
from pipelines.lake_care.tables import chosen
from pipelines.workspace import Workspace
from services.lake import maintenance
from services.lake.statistics import column_statistics
from services.lake.statistics import sample as draw

SHOWN_ITEMS = 6


def info(workspace: Workspace, form: str) -> None:
    """Print what each table takes up, and the rows of each data set."""
    lake = workspace.lake
    tables = [maintenance.info(lake, name) for name in lake.tables()]
    records = [
        {
            "table": each.table,
            "rows": each.rows,
            "files": each.files,
            "bytes": each.nbytes,
            "stored bytes": each.stored_bytes,
            "version": each.version,
            "schema": each.schema_version,
            "log entries": each.log_entries,
            "rows by data set": each.by_dataset,
        }
        for each in tables
    ]
    if form != "table":
        print_records(records, form)
        return
    for record, each in zip(records, tables, strict=True):
        record |= {"bytes": size(each.nbytes), "stored bytes": size(each.stored_bytes)}
    print_records(records, form)
    stored = size(sum(each.stored_bytes for each in tables))
    said(f"{sum(each.rows for each in tables)} rows, {stored} with all versions and logs")


def history(workspace: Workspace, table: str, limit: int | None, form: str) -> None:
    """Print the versions of a table, newest first."""
    chosen([table], workspace.lake.tables())
    versions = maintenance.history(workspace.lake, table, limit)
    if form == "table":
        for each in versions:
            each["notes"] = {key.removeprefix("lmtr."): each["notes"][key] for key in each["notes"]}
    print_records(versions, form)


def stats(
    workspace: Workspace,
    table: str,
    where: str | None,
    columns: Sequence[str] | None,
    form: str,
) -> None:
    """Print statistics of the columns of a table; entries of x and τ have their names."""
    chosen([table], workspace.lake.tables())
    entries = {"x": entry_names(TASK_LAYOUT), "tau": entry_names(SEGMENT_LAYOUT)}
    found = column_statistics(workspace.lake, table, where, columns or None, entries)
    records = [each.as_record() for each in found]
    print_records(_narrowed(records) if form == "table" else records, form)


def _narrowed(records: Sequence[dict[str, object]]) -> list[dict[str, object]]:
    """What fits a terminal: the plainest figures, to four digits; counts of what occurs."""
    shown = ["unit", "count", "nulls", "not_finite", "min", "q50", "max", "mean", "std"]
    for rare in ("nulls", "not_finite"):
        if not any(map(itemgetter(rare), records)):
            shown.remove(rare)
    return [
        {"column": f"{each['column']} {each['entry']}".rstrip()}
        | {name: _to_four_digits(each[name]) for name in shown}
        for each in records
    ]


def _to_four_digits(value: object) -> object:
    return float(f"{value:.4g}") if isinstance(value, float) else value


def sample(
    workspace: Workspace, table: str, count: int, where: str | None, seed: int, form: str
) -> None:
    """Print rows drawn at random, one after the other."""
    chosen([table], workspace.lake.tables())
    rows = draw(workspace.lake, table, count, where, seed).to_pylist()
    if form == "json":
        print_records([_with_maps(row) for row in rows], form)
        return
    for number, row in enumerate(rows, start=1):
        fields = [{"column": name, "value": _brief(value)} for name, value in row.items()]
        print_records(fields, form, title=f"row {number} of {len(rows)}")


def entry_names(layout: Layout) -> list[tuple[str, str]]:
    """Name and unit of each number of a packed vector: ``base_nodes[3,1,0]``, ``m/s``."""
    return [
        (f"{each.name}[{','.join(map(str, index))}]" if index else each.name, _unit(each, index))
        for each in layout.fields
        for index in np.ndindex(each.shape)
    ]


def _unit(each: Field, index: tuple[int, ...]) -> str:
    """The unit of one number; a field's units are told by its last axes, ``;`` before ``,``."""
    unit = each.unit
    if ";" in unit:
        unit = [part.strip() for part in unit.split(";")][index[-2]]
    if "," in unit:
        parts = [part.strip() for part in unit.split(",")]
        unit = parts[index[-1] * len(parts) // each.shape[-1]]
    return unit


def _with_maps(row: dict[str, object]) -> dict[str, object]:
    """Maps, which Arrow gives as pairs, as objects."""
    return {
        name: dict(value)
        if isinstance(value, list) and value and isinstance(value[0], tuple)
        else value
        for name, value in row.items()
    }


def _brief(value: object) -> str:
    if not isinstance(value, list):
        return cell(value)
    if value and isinstance(value[0], tuple):
        return ", ".join(f"{key}={cell(item)}" for key, item in value)
    shown = ", ".join(cell(item) for item in value[:SHOWN_ITEMS])
    more = f", … {len(value)} values" if len(value) > SHOWN_ITEMS else ""
    return f"[{shown}{more}]"
