"""Where the numbers of a linear system lie in one array.

First come the fronts' pivot columns, column by column, which become the factor; then the rows of
J_d by groups, row by row; then three numbers for each slack; then a stack of what fronts hand on to
their parents. Columns and rows are padded to vector registers.
"""

import numpy as np

from lmtr.arrays import Indices
from lmtr.expert.kkt.elimination import Elimination, Front
from lmtr.expert.kkt.structure import KktStructure

LANES = 8
"""Numbers in a vector register."""

PER_SLACK = 3
"""Numbers of a slack: its diagonal, its entry in the row of y_d, and the diagonal of y_d."""


class Layout:
    """Where the numbers of a system lie in the array of its values."""

    def __init__(self, structure: KktStructure, elimination: Elimination) -> None:
        fronts, groups = elimination.fronts, structure.groups
        self.border_stride = [_padded(len(front.border)) for front in fronts]
        self.stride = [
            _padded(front.pivots + border)
            for front, border in zip(fronts, self.border_stride, strict=True)
        ]
        # Pivot columns are worked on four at a time.
        sizes = [s * _padded(front.pivots, 4) for s, front in zip(self.stride, fronts, strict=True)]
        self.panel = offsets(sizes)
        self.group_stride = [_padded(len(group.columns)) for group in groups]
        heights = [group.rows[1] - group.rows[0] for group in groups]
        sizes = [s * height for s, height in zip(self.group_stride, heights, strict=True)]
        self.group = self.panel[-1] + offsets(sizes)
        self.slacks = int(self.group[-1])
        self.stack = _padded(self.slacks + PER_SLACK * structure.n_inequalities)
        self.stack_offset, stack_size = _stacked(elimination, self.border_stride)
        self.size = self.stack + stack_size
        self.position = np.argsort(elimination.order)
        self._firsts = np.array([front.first for front in fronts])
        self._front_of = np.repeat(np.arange(len(fronts)), [front.pivots for front in fronts])
        self._local = _local_rows(fronts, len(elimination.order))

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


def _local_rows(fronts: list[Front], size: int) -> Indices:
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
    begins: list[int] = []
    waiting: list[int] = []
    size = 0
    parents = elimination.parents
    for front in range(len(parents)):
        begin, needed = 0, stride[front] ** 2
        for other in sorted(waiting, key=lambda o: begins[o]):
            if begin + needed <= begins[other]:
                break
            begin = max(begin, begins[other] + stride[other] ** 2)
        begins.append(begin)
        size = max(size, begin + needed)
        waiting = [other for other in waiting if parents[other] != front] + [front]
    return begins, size


def offsets(sizes: list[int]) -> Indices:
    """Where parts of these sizes begin when laid end to end, and where the last one ends."""
    return np.concatenate([[0], np.cumsum(sizes, dtype=np.intp)]).astype(np.intp)


def _padded(size: int, multiple: int = LANES) -> int:
    return -(-size // multiple) * multiple
