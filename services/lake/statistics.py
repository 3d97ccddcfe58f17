"""Statistics of the columns of a table, and rows drawn from it, in bounded memory."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from services.lake.schemas import IDENTITY, SCHEMAS
from services.lake.tables import Lake

QUANTILES = (0.01, 0.1, 0.5, 0.9, 0.99)

KEPT_ROWS = 100_000
"""Rows that quantiles are taken from: all of a table up to so many, else an even draw of about
that many, of which the rank of a quantile is known to a third of a percent."""


@dataclass(frozen=True)
class ColumnStatistics:
    """Statistics of one quantity.

    Attributes:
        column: Column of the table.
        entry: Which number of a vector, which key of a map; empty for a whole column.
        unit: SI unit; empty where there is none or it is not known.
        count: Values that are there.
        nulls: Rows without a value.
        not_finite: Values that are NaN or infinite, which the figures below leave out.
        least: Smallest value; None for text and where there is no value, like all below.
        greatest: Largest value.
        mean: Mean.
        deviation: Standard deviation of the population.
        quantiles: At :data:`QUANTILES`.
    """

    column: str
    entry: str
    unit: str
    count: int
    nulls: int
    not_finite: int = 0
    least: float | None = None
    greatest: float | None = None
    mean: float | None = None
    deviation: float | None = None
    quantiles: tuple[float, ...] | None = None

    def as_record(self) -> dict[str, object]:
        """Flat, with LeRobot's names of quantiles: ``q01`` … ``q99``."""
        quantiles = self.quantiles or (None,) * len(QUANTILES)
        return {
            "column": self.column,
            "entry": self.entry,
            "unit": self.unit,
            "count": self.count,
            "nulls": self.nulls,
            "not_finite": self.not_finite,
            "min": self.least,
            "max": self.greatest,
            "mean": self.mean,
            "std": self.deviation,
            **{f"q{100 * q:02.0f}": v for q, v in zip(QUANTILES, quantiles, strict=True)},
        }


@dataclass
class _Running:
    """Moments of ``width`` quantities, and an even draw of their values.

    The moments of batches are joined by Chan's rule, which loses no digits to a large mean.
    """

    width: int
    count: np.ndarray = field(init=False)
    not_finite: np.ndarray = field(init=False)
    mean: np.ndarray = field(init=False)
    squares: np.ndarray = field(init=False)
    least: np.ndarray = field(init=False)
    greatest: np.ndarray = field(init=False)
    drawn: list[np.ndarray] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.count, self.not_finite = (np.zeros(self.width, dtype=np.int64) for _ in range(2))
        self.mean, self.squares = np.zeros(self.width), np.zeros(self.width)
        self.least, self.greatest = np.full(self.width, np.inf), np.full(self.width, -np.inf)

    def add(self, values: np.ndarray, share: float, rng: np.random.Generator) -> None:
        """Take in values (n, width)."""
        if not len(values):
            return
        finite = np.isfinite(values)
        count = finite.sum(axis=0)
        safe = np.where(finite, values, 0.0)
        mean = safe.sum(axis=0) / np.maximum(count, 1)
        squares = (np.where(finite, values - mean, 0.0) ** 2).sum(axis=0)
        total = np.maximum(self.count + count, 1)
        step = mean - self.mean
        self.squares += squares + step**2 * self.count * count / total
        self.mean += step * count / total
        self.count += count
        self.not_finite += len(values) - count
        self.least = np.minimum(self.least, np.where(finite, values, np.inf).min(axis=0))
        self.greatest = np.maximum(self.greatest, np.where(finite, values, -np.inf).max(axis=0))
        self.drawn.append(values if share >= 1.0 else values[rng.random(len(values)) < share])

    def told(
        self, column: str, names: Sequence[tuple[str, str]], nulls: int
    ) -> Iterator[ColumnStatistics]:
        """The statistics of each quantity; ``names`` are entries and units."""
        drawn = np.concatenate(self.drawn) if self.drawn else np.empty((0, self.width))
        for at, (entry, unit) in enumerate(names):
            count, bad = int(self.count[at]), int(self.not_finite[at])
            if not count:
                yield ColumnStatistics(column, entry, unit, bad, nulls, bad)
                continue
            kept = drawn[:, at][np.isfinite(drawn[:, at])]
            quantiles = np.quantile(kept, QUANTILES).tolist() if len(kept) else None
            yield ColumnStatistics(
                column,
                entry,
                unit,
                count + bad,
                nulls,
                bad,
                float(self.least[at]),
                float(self.greatest[at]),
                float(self.mean[at]),
                float(np.sqrt(self.squares[at] / count)),
                tuple(quantiles) if quantiles else None,
            )


def column_statistics(
    lake: Lake,
    table: str,
    where: str | None = None,
    columns: Sequence[str] | None = None,
    entries: Mapping[str, Sequence[tuple[str, str]]] | None = None,
) -> list[ColumnStatistics]:
    """Statistics of the columns of a table.

    Numbers and truth values (as 0 and 1) get all figures, text and times only their counts. A
    vector of fixed length gets them for each entry, a map for each key, any other list for all its
    values together.

    Args:
        lake: The lake.
        table: Name of the table.
        where: Condition in SQL on the rows.
        columns: Which columns; all by default.
        entries: Names and units of the entries of vectors, by column; numbers by default.

    Raises:
        LakeError: The table or a column is missing, or the SQL is wrong.
    """
    key = list(IDENTITY[table][:1])
    total = sum(batch.num_rows for batch in lake.batches(table, key, where))
    share, rng = KEPT_ROWS / max(total, 1), np.random.default_rng(0)
    fields = [each for each in SCHEMAS[table] if columns is None or each.name in columns]
    gathered = {each.name: _Gathered(each) for each in fields}
    for batch in lake.batches(table, columns, where):
        for name, gather in gathered.items():
            gather.add(batch[name].combine_chunks(), share, rng)
    return [
        each for name, gather in gathered.items() for each in gather.told((entries or {}).get(name))
    ]


class _Gathered:
    """What is known of one column."""

    def __init__(self, column: pa.Field) -> None:
        self._column = column
        self._nulls = 0
        self._present = 0
        self._by_key: dict[str, _Running] = {}

    def add(self, values: pa.Array, share: float, rng: np.random.Generator) -> None:
        """Take in values of the column."""
        self._nulls += values.null_count
        self._present += len(values) - values.null_count
        for key, numbers in _numbers(values.drop_null()):
            running = self._by_key.setdefault(key, _Running(numbers.shape[1]))
            running.add(numbers, share, rng)

    def told(self, names: Sequence[tuple[str, str]] | None) -> Iterator[ColumnStatistics]:
        """The statistics of the column, or of each of its entries."""
        name, kind = self._column.name, self._column.type
        unit = (self._column.metadata or {}).get(b"unit", b"").decode()
        if not self._by_key:
            yield ColumnStatistics(name, "", unit, self._present, self._nulls)
        for key, running in sorted(self._by_key.items()):
            own = [(key, unit)]
            if pa.types.is_fixed_size_list(kind):
                own = [(str(at), unit) for at in range(running.width)]
            yield from running.told(name, names or own, self._nulls)


def _numbers(values: pa.Array) -> Iterator[tuple[str, np.ndarray]]:
    """The numbers of values that are there, (n, width), by key; none of text."""
    kind = values.type
    if pa.types.is_map(kind):
        entries = values.cast(pa.list_(pa.struct([("k", kind.key_type), ("v", kind.item_type)])))
        flat = pc.list_flatten(entries)
        keys = flat.field("k").dictionary_encode()
        numbers, codes = _as_reals(flat.field("v")), keys.indices.to_numpy()
        for code, key in enumerate(keys.dictionary.to_pylist()):
            yield key, numbers[codes == code][:, None]
        return
    width = kind.list_size if pa.types.is_fixed_size_list(kind) else 1
    flat = pc.list_flatten(values) if pa.types.is_list(kind) or width > 1 else values
    if pa.types.is_floating(flat.type) or pa.types.is_integer(flat.type):
        yield "", _as_reals(flat).reshape(-1, width)
    elif pa.types.is_boolean(flat.type):
        yield "", _as_reals(flat.cast(pa.int8())).reshape(-1, width)


def _as_reals(values: pa.Array) -> np.ndarray:
    return np.asarray(values.to_numpy(zero_copy_only=False), dtype=np.float64)


def sample(lake: Lake, table: str, count: int, where: str | None = None, seed: int = 0) -> pa.Table:
    """Rows drawn at random, the same ones for the same seed whatever order they lie in.

    A row's place in the draw is a digest of its identity and the seed, so rows that are added later
    or files that are joined do not change the order of the others.

    Raises:
        LakeError: The table is missing, or the SQL is wrong.
    """
    parts = ", ".join(f'"{name}"' for name in IDENTITY[table])
    order = f"md5(concat_ws('/', {int(seed)}, {parts}))"
    return lake.read(table, where=where, order_by=order, limit=count)
