"""C source of a linear solver: tables of where everything goes, before the numeric kernel."""

from collections.abc import Iterable
from importlib.resources import files

import numpy as np

from lmtr.arrays import Indices
from lmtr.expert.kkt.elimination import Elimination, eliminate
from lmtr.expert.kkt.layout import LANES, PER_SLACK, Layout, offsets
from lmtr.expert.kkt.structure import MAX_GROUP, KktStructure
from lmtr.expert.shared_library import FLAGS

KERNEL_FLAGS = (
    *FLAGS,
    "-O3",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fno-signed-zeros",
    "-fassociative-math",
)
"""Sums may be reordered into vector registers; infinities and NaN still count as such."""


def source(structure: KktStructure) -> str:
    """C source of the linear solver for one structure.

    Its entry points are those of MA27: ``ma27id_``, ``ma27ad_``, ``ma27bd_``, ``ma27cd_``.
    """
    elimination = eliminate(structure.condensed)
    layout = Layout(structure, elimination)
    tables = _Tables()
    tables.constants(
        LANES=LANES,
        N_KKT=structure.size,
        N_CONDENSED=len(elimination.order),
        N_FRONTS=len(elimination.fronts),
        N_GROUPS=len(structure.groups),
        N_EQUALITIES=structure.n_equalities,
        FIRST_SLACK=structure.n_variables,
        FIRST_Y=structure.size - structure.n_inequalities,
        PER_SLACK=PER_SLACK,
        MAX_GROUP=MAX_GROUP,
        MAX_COLUMNS=max([0, *layout.group_stride]) + LANES,
        MAX_PIVOTS=max(front.pivots for front in elimination.fronts),
        MAX_BORDER=max(layout.border_stride) + LANES,
    )
    _add_fronts(tables, layout, structure, elimination)
    _add_groups(tables, layout, structure)
    _add_entries(tables, layout, structure)
    kernel = files("lmtr.expert.kkt").joinpath("kernel.c").read_text()
    return "\n".join([*tables.lines, kernel])


class _Tables:
    """Constants and constant arrays, as lines of C."""

    def __init__(self) -> None:
        self.lines = ["#include <stdint.h>"]

    def constants(self, **values: int) -> None:
        self.lines += [f"#define {name} {value}" for name, value in values.items()]

    def array(self, name: str, values: Iterable[int] | Indices, kind: str = "int") -> None:
        numbers = np.asarray(list(values), dtype=np.int64).tolist() or [0]
        self.lines.append(f"static const {kind} {name}[] = {{{','.join(map(str, numbers))}}};")


def _add_fronts(
    tables: _Tables, layout: Layout, structure: KktStructure, elimination: Elimination
) -> None:
    fronts, parents = elimination.fronts, elimination.parents
    n, n_slacks = structure.n_variables, structure.n_inequalities
    of_whole = np.where(elimination.order < n, elimination.order, elimination.order + n_slacks)
    children: list[list[int]] = [[] for _ in fronts]
    for front, parent in enumerate(parents):
        if parent >= 0:
            children[parent].append(front)
    relative = [
        layout.relative(front, parent) if parent >= 0 else front.border[:0]
        for front, parent in zip(fronts, parents, strict=True)
    ]
    tables.array("order", of_whole)
    tables.array("front_first", [front.first for front in fronts])
    tables.array("front_pivots", [front.pivots for front in fronts])
    tables.array("front_border", [len(front.border) for front in fronts])
    tables.array("front_stride", layout.stride)
    tables.array("border_stride", layout.border_stride)
    tables.array("front_panel", layout.panel[:-1])
    tables.array("front_stack", layout.stack_offset)
    tables.array("border_begin", offsets([len(front.border) for front in fronts]))
    tables.array("border_row", np.concatenate([front.border for front in fronts]))
    runs = [_runs(rows) for rows in relative]
    tables.array("run_begin", offsets([len(of) for of in runs]))
    tables.array("run_first", [first for of in runs for first, _, _ in of])
    tables.array("run_length", [length for of in runs for _, length, _ in of])
    tables.array("run_to", [to for of in runs for _, _, to in of])
    tables.array("child_begin", offsets([len(of) for of in children]))
    tables.array("child", [child for of in children for child in of])


def _runs(rows: Indices) -> list[tuple[int, int, int]]:
    """Runs of consecutive numbers: where each begins, its length, and its first number."""
    begins = np.flatnonzero(np.diff(rows, prepend=-2) != 1)
    lengths = np.diff(begins, append=len(rows))
    return list(zip(begins.tolist(), lengths.tolist(), rows[begins].tolist(), strict=True))


def _add_groups(tables: _Tables, layout: Layout, structure: KktStructure) -> None:
    places = []
    for group in structure.groups:
        column, row = np.triu_indices(len(group.columns))  # column by column, downwards
        places.append(layout.places(group.columns[row], group.columns[column]))
    tables.array("group_first", [*(g.rows[0] for g in structure.groups), structure.n_inequalities])
    tables.array("group_columns", [len(group.columns) for group in structure.groups])
    tables.array("group_stride", layout.group_stride)
    tables.array("group_values", layout.group[:-1])
    tables.array("column_begin", offsets([len(group.columns) for group in structure.groups]))
    tables.array("column", _joined([group.columns for group in structure.groups]))
    tables.array("target_begin", offsets([len(targets) for targets in places]))
    tables.array("target", _joined(places))


def _add_entries(tables: _Tables, layout: Layout, structure: KktStructure) -> None:
    """Every entry of the whole system that may be nonzero, and where its value goes."""
    n, n_c, n_d = structure.n_variables, structure.n_equalities, structure.n_inequalities
    y_c, y_d = n + n_d, n + n_d + n_c
    whole: list[tuple[Indices, Indices, Indices]] = []
    lower = structure.hessian.tocoo()
    kept = lower.row >= lower.col
    whole.append(
        (lower.row[kept], lower.col[kept], layout.places(lower.row[kept], lower.col[kept]))
    )
    rows = structure.equalities.tocoo()
    whole.append((y_c + rows.row, rows.col, layout.places(n + rows.row, rows.col)))
    corner = np.arange(n_c)
    at_corner = layout.places(n + corner, n + corner)
    tables.array("corner", at_corner)
    whole.append((y_c + corner, y_c + corner, at_corner))
    for group, begin, stride in zip(
        structure.groups, layout.group[:-1], layout.group_stride, strict=True
    ):
        entries = structure.inequalities[slice(*group.rows)].tocoo()
        column = np.searchsorted(group.columns, entries.col)
        row = y_d + group.rows[0] + entries.row
        whole.append((row, entries.col, begin + stride * entries.row + column))
    slack = np.arange(n_d)
    at = layout.slacks + PER_SLACK * slack
    whole.append((n + slack, n + slack, at))
    whole.append((y_d + slack, n + slack, at + 1))
    whole.append((y_d + slack, y_d + slack, at + 2))
    row, column, place = (
        np.concatenate(part).astype(np.int64) for part in zip(*whole, strict=True)
    )
    key = row * structure.size + column
    by_key = np.argsort(key)
    tables.constants(
        N_ENTRIES=len(key), SLACKS=layout.slacks, STACK=layout.stack, N_VALUES=layout.size
    )
    tables.array("entry_key", key[by_key], "int64_t")
    tables.array("entry_place", place[by_key])


def _joined(parts: list[Indices]) -> Indices:
    return np.concatenate([np.empty(0, np.intp), *parts])
