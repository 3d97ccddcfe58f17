"""What the tables of a lake say of each other, and the layouts that data sets were made with."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import pyarrow.dataset as pads

from lmtr.errors import DataError
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT, Layout
from services.lake.inspection import Finding
from services.lake.sandbox import evaluated

LAYOUTS = {"task": TASK_LAYOUT, "segment": SEGMENT_LAYOUT}


@dataclass(frozen=True)
class Reference:
    """Rows that must name rows of another table.

    Attributes:
        table: Whose rows they are.
        needs: Tables that the question is put to.
        says: What must hold.
        strays: SQL for those that do not; one column, each stray once.
        mend: What to do about them.
    """

    table: str
    needs: tuple[str, ...]
    says: str
    strays: str
    mend: str


@dataclass(frozen=True)
class Progress:
    """How far a data set is.

    Attributes:
        dataset_id: The data set.
        asked_first: Solutions that were asked for when it was made; it may have been extended.
        solved: Solutions that are there, whatever came of them.
        accepted: Those that the filter kept.
        segments: Segments cut from them, all cuts together.
    """

    dataset_id: str
    asked_first: int | None
    solved: int
    accepted: int
    segments: int


def _of_a_dataset(table: str) -> Reference:
    return Reference(
        table,
        ("datasets", table),
        "its data set is in table datasets",
        f"SELECT DISTINCT dataset_id FROM {table} ANTI JOIN datasets USING (dataset_id)",
        "run `lmtr generate` with the settings of that data set: it describes it again",
    )


REFERENCES = (
    *map(_of_a_dataset, ("solutions", "cuts", "segments", "models", "evaluations")),
    Reference(
        "segments",
        ("segments", "solutions"),
        "the solution that it was cut from is there and accepted",
        """
        SELECT DISTINCT dataset_id || ', solution ' || solution_index
        FROM segments ANTI JOIN (
            SELECT dataset_id, "index" AS solution_index FROM solutions WHERE accepted
        ) USING (dataset_id, solution_index)
        """,
        "run `lmtr generate` again: it solves what is missing, with the same numbers",
    ),
    Reference(
        "segments",
        ("segments", "cuts"),
        "the way that it was cut is in table cuts",
        """
        SELECT DISTINCT dataset_id || ', cut ' || segmentation_id
        FROM segments ANTI JOIN cuts USING (dataset_id, segmentation_id)
        """,
        "run `lmtr segment` with the settings of that cut: it describes it again",
    ),
    Reference(
        "rollouts",
        ("rollouts", "evaluations"),
        "its evaluation is in table evaluations",
        "SELECT DISTINCT evaluation_id FROM rollouts ANTI JOIN evaluations USING (evaluation_id)",
        "run `lmtr evaluate` again",
    ),
)
"""What is asked of the tables together."""


def reference_findings(rows: Mapping[str, pads.Dataset], most: int) -> Iterator[Finding]:
    """Rows that name what is not there.

    Args:
        rows: The readable rows of each table; questions to a table that is not among them are
            left out.
        most: Strays to name of each kind.
    """
    for reference in REFERENCES:
        if not rows.keys() >= set(reference.needs):
            continue
        sql = f"SELECT *, count(*) OVER () FROM ({reference.strays}) ORDER BY 1 LIMIT {int(most)}"
        with evaluated({name: rows[name] for name in reference.needs}, sql) as relation:
            strays = relation.fetchall()
        if strays:
            names = [str(name) for name, _ in strays]
            count = int(strays[0][1])
            yield Finding(
                reference.table, "reference", reference.says, reference.mend, count, names
            )


def layout_findings(datasets: pads.Dataset) -> Iterator[Finding]:
    """Data sets whose vectors are laid out in another way than this LMTR's."""
    mend = "use it with the LMTR that made it, or generate a data set anew"
    for row in datasets.to_table(columns=["dataset_id", "layouts"]).to_pylist():
        fault = _layout_fault(row["layouts"])
        if fault:
            subject = f"{row['dataset_id']}: {fault}"
            says = "its layouts are those of this LMTR"
            yield Finding("datasets", "layout", says, mend, 1, [subject])


def progress_of(rows: Mapping[str, pads.Dataset]) -> list[Progress]:
    """How far each data set is, as far as tables can be read."""
    if "datasets" not in rows:
        return []
    described = rows["datasets"].to_table(columns=["dataset_id", "configuration"]).to_pylist()
    solved = _counts(rows, "solutions", "count(*)")
    accepted = _counts(rows, "solutions", "count(*) FILTER (accepted)")
    segments = _counts(rows, "segments", "count(*)")
    return [
        Progress(
            each["dataset_id"],
            _asked(each["configuration"]),
            *(counts.get(each["dataset_id"], 0) for counts in (solved, accepted, segments)),
        )
        for each in described
    ]


def _counts(rows: Mapping[str, pads.Dataset], table: str, figure: str) -> dict[str, int]:
    if table not in rows:
        return {}
    sql = f"SELECT dataset_id, {figure} FROM {table} GROUP BY ALL"
    with evaluated({table: rows[table]}, sql) as relation:
        return dict(relation.fetchall())


def _asked(configuration: str) -> int | None:
    try:
        return int(json.loads(configuration)["dataset"]["solutions"])
    except (ValueError, KeyError, TypeError):
        return None


def _layout_fault(text: str) -> str:
    try:
        told = json.loads(text)
        for name, layout in LAYOUTS.items():
            layout.require_equal(Layout.from_metadata(told[name]))
    except DataError as error:
        return str(error)
    except (ValueError, KeyError, TypeError) as error:
        return f"cannot be read ({error!r})"
    return ""
