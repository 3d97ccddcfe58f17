"""C source of a linear solver: tables of where everything goes, before the numeric kernel.

All values of a system lie in one array: the fronts' pivot columns, which become the factor; the
rows of J_d by groups; and three numbers for each slack. Intermediate results follow, as a stack.
"""

from collections.abc import Iterable
from importlib.resources import files

import numpy as np

from lmtr.arrays import Indices
from lmtr.expert.kkt.elimination import Elimination, Front, eliminate
from lmtr.expert.kkt.structure import MAX_GROUP, KktStructure
from lmtr.expert.shared_library import FLAGS

LANES = 8
"""Numbers in a vector register, which columns are padded to."""

KERNEL_FLAGS = (
    *FLAGS,
    "-O3",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fno-signed-zeros",
    "-fassociative-math",
)
"""Sums may be reordered into vector registers; infinities and NaN still count as such."""

PER_SLACK = 3
"""Numbers of a slack: its diagonal, its entry in the row of y_d, and the diagonal of y_d."""


def source(structure: KktStructure) -> str:
    """C source of the linear solver for one structure.

    Its entry points are those of MA27: ``ma27id_``, ``ma27ad_``, ``ma27bd_``, ``ma27cd_``.
    """
    elimination = eliminate(structure.condensed)
    layout = _Layout(structure, elimination)
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


class _Layout:
    """Where the numbers of a system lie in the array of its values."""

    def __init__(self, structure: KktStructure, elimination: Elimination) -> None:
        fronts, groups = elimination.fronts, structure.groups
        self.border_stride = [_padded(len(front.border)) for front in fronts]
        self.stride = [
            _padded(front.pivots + border)
            for front, border in zip(fronts, self.border_stride, strict=True)
        ]
        sizes = [stride * f.pivots for stride, f in zip(self.stride, fronts, strict=True)]
        self.panel = _offsets(sizes)
        self.group_stride = [_padded(len(group.columns)) for group in groups]
        heights = [group.rows[1] - group.rows[0] for group in groups]
        sizes = [s * height for s, height in zip(self.group_stride, heights, strict=True)]
        self.group = self.panel[-1] + _offsets(sizes)
        self.slacks = int(self.group[-1])
        self.stack = _padded(self.slacks + PER_SLACK * structure.n_inequalities)
        self.stack_offset, stack_size = _stacked(elimination, self.border_stride)
        self.size = self.stack + stack_size
        self.position = np.argsort(elimination.order)
        self._firsts = np.array([front.first for front in fronts])
        self._front_of = np.repeat(np.arange(len(fronts)), [front.pivots for front in fronts])
        self._local = local_rows(fronts, len(elimination.order))

    def places(self, rows: Indices, columns: Indices) -> Indices:
        """Where entries of the condensed matrix lie, given by unknowns of either triangle."""
        at_rows, at_columns = self.position[rows], self.position[columns]
        pivot, row = np.minimum(at_rows, at_columns), np.maximum(at_rows, at_columns)
        front = self._front_of[pivot]
        column = pivot - self._firsts[front]
        stride = np.array(self.stride)[front]
        return np.asarray(self.panel[front] + self._local[front, row] + stride * column)

    def relative(self, child: Front, parent: int) -> Indices:
        """Rows of the parent's front that a child's border goes to."""
        return np.asarray(self._local[parent, child.border])


def local_rows(fronts: list[Front], size: int) -> Indices:
    """Row in each front of every unknown in the order of elimination, −1 where it has none."""
    local = np.full((len(fronts), size), -1, dtype=np.intp)
    for number, front in enumerate(fronts):
        pivots = front.first + np.arange(front.pivots)
        local[number, np.concatenate([pivots, front.border])] = np.arange(front.rows)
    return local


def _stacked(elimination: Elimination, stride: list[int]) -> tuple[list[int], int]:
    """Places in the stack for what fronts hand on to their parents, and the size of the stack.

    Each takes the lowest place that is free; its own is free once its parent has taken it over.
    """
    offsets: list[int] = []
    waiting: list[int] = []
    size = 0
    parents = elimination.parents
    for front in range(len(parents)):
        begin, needed = 0, stride[front] ** 2
        for other in sorted(waiting, key=lambda o: offsets[o]):
            if begin + needed <= offsets[other]:
                break
            begin = max(begin, offsets[other] + stride[other] ** 2)
        offsets.append(begin)
        size = max(size, begin + needed)
        waiting = [other for other in waiting if parents[other] != front] + [front]
    return offsets, size


def _add_fronts(
    tables: _Tables, layout: _Layout, structure: KktStructure, elimination: Elimination
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
    tables.array("border_begin", _offsets([len(front.border) for front in fronts]))
    tables.array("border_row", np.concatenate([front.border for front in fronts]))
    runs = [_runs(rows) for rows in relative]
    tables.array("run_begin", _offsets([len(of) for of in runs]))
    tables.array("run_first", [first for of in runs for first, _, _ in of])
    tables.array("run_length", [length for of in runs for _, length, _ in of])
    tables.array("run_to", [to for of in runs for _, _, to in of])
    tables.array("child_begin", _offsets([len(of) for of in children]))
    tables.array("child", [child for of in children for child in of])


def _runs(rows: Indices) -> list[tuple[int, int, int]]:
    """Runs of consecutive numbers: where each begins, its length, and its first number."""
    begins = np.flatnonzero(np.diff(rows, prepend=-2) != 1)
    lengths = np.diff(begins, append=len(rows))
    return list(zip(begins.tolist(), lengths.tolist(), rows[begins].tolist(), strict=True))


def _add_groups(tables: _Tables, layout: _Layout, structure: KktStructure) -> None:
    places = []
    for group in structure.groups:
        column, row = np.triu_indices(len(group.columns))  # column by column, downwards
        places.append(layout.places(group.columns[row], group.columns[column]))
    tables.array("group_first", [*(g.rows[0] for g in structure.groups), structure.n_inequalities])
    tables.array("group_columns", [len(group.columns) for group in structure.groups])
    tables.array("group_stride", layout.group_stride)
    tables.array("group_values", layout.group[:-1])
    tables.array("column_begin", _offsets([len(group.columns) for group in structure.groups]))
    tables.array("column", _joined([group.columns for group in structure.groups]))
    tables.array("target_begin", _offsets([len(targets) for targets in places]))
    tables.array("target", _joined(places))


def _add_entries(tables: _Tables, layout: _Layout, structure: KktStructure) -> None:
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


def _padded(size: int) -> int:
    return -(-size // LANES) * LANES


def _offsets(sizes: list[int]) -> Indices:
    return np.concatenate([[0], np.cumsum(sizes, dtype=np.intp)]).astype(np.intp)


def _joined(parts: list[Indices]) -> Indices:
    return np.concatenate([np.empty(0, np.intp), *parts])
