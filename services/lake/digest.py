"""A digest for each row, taken where the row is made, so that any later damage can be told.

It covers the row's identity and its numbers, and leaves out what differs between two runs that did
the same: times of day, processor time, code versions. So two data sets are the same to the last bit
where their digests are, and a byte that changed on its way through network and disk is found.
"""

from collections.abc import Callable, Sequence
from hashlib import blake2b

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from services.lake.schemas import SCHEMAS, UNDIGESTED

COLUMN = "digest"
"""Name of the column that holds it."""

DIGEST_BYTES = 8

_NULL = b"\xff"
_VALUE = b"\x00"


def digested_columns(table: str) -> tuple[str, ...]:
    """Columns that a digest of this table covers, in their order."""
    return tuple(name for name in SCHEMAS[table].names if name not in UNDIGESTED)


def has_digest(table: str) -> bool:
    """Whether rows of this table carry one."""
    return COLUMN in SCHEMAS[table].names


def sealed(table: str, rows: pa.Table) -> pa.Table:
    """The rows with their digests, replacing those that are there."""
    digests = pa.array(row_digests(table, rows), pa.string())
    field = SCHEMAS[table].field(COLUMN)
    if COLUMN in rows.column_names:
        return rows.set_column(rows.schema.get_field_index(COLUMN), field, digests)
    return rows.append_column(field, digests)


def row_digests(table: str, rows: pa.Table) -> list[str]:
    """Sixteen hexadecimal digits for each row.

    Numbers enter as little-endian 64-bit words (single precision as 32-bit ones), text as UTF-8,
    lists with their length, a map as its keys and its values; null differs from all of them. The
    columns' names enter too.
    """
    hashes = [blake2b(digest_size=DIGEST_BYTES) for _ in range(rows.num_rows)]
    for name in digested_columns(table):
        if name not in rows.column_names:
            continue
        head = name.encode() + b"\x00"
        for hasher, content in zip(hashes, _contents(rows[name]), strict=True):
            hasher.update(head + content)
    return [hasher.hexdigest() for hasher in hashes]


def _contents(column: pa.ChunkedArray) -> list[bytes]:
    contents: list[bytes] = []
    for chunk in column.chunks:
        contents.extend(_of_array(chunk))
    return contents


def _of_array(array: pa.Array) -> list[bytes]:
    """Content of each value; nulls by themselves."""
    kind = array.type
    make: Callable[[pa.Array], Sequence[bytes]] = _of_numbers
    if pa.types.is_string(kind):
        make = _of_text
    elif pa.types.is_map(kind):
        make = _of_maps
    elif pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind):
        make = _of_lists
    if not array.null_count:
        return [_VALUE + content for content in make(array)]
    valid = pc.is_valid(array).to_numpy(zero_copy_only=False)
    present = iter(make(array.filter(pc.is_valid(array))))
    return [_VALUE + next(present) if is_valid else _NULL for is_valid in valid]


def _of_text(array: pa.Array) -> list[bytes]:
    return [len(text).to_bytes(8, "little") + text for text in map(str.encode, array.to_pylist())]


def _of_numbers(array: pa.Array) -> list[bytes]:
    words = _words(array)
    size = words.dtype.itemsize
    raw = words.tobytes()
    return [raw[at : at + size] for at in range(0, len(raw), size)]


def _words(array: pa.Array) -> np.ndarray:
    """Numbers without nulls as the words that are digested."""
    kind = array.type
    if pa.types.is_timestamp(kind):
        array, kind = array.cast(pa.int64()), pa.int64()
    numbers = array.to_numpy(zero_copy_only=False)
    if pa.types.is_float32(kind):
        return np.ascontiguousarray(numbers, "<f4")
    return np.ascontiguousarray(numbers, "<f8" if pa.types.is_floating(kind) else "<i8")


def _of_lists(array: pa.Array) -> list[bytes]:
    counts = pc.list_value_length(array).to_numpy(zero_copy_only=False)
    return _grouped(array.flatten(), counts)


def _of_maps(array: pa.MapArray) -> list[bytes]:
    entries = array.cast(pa.list_(pa.struct([("k", array.type.key_type), ("v", pa.float64())])))
    counts = pc.list_value_length(entries).to_numpy(zero_copy_only=False)
    keys, values = entries.flatten().flatten()
    return [
        key + value
        for key, value in zip(_grouped(keys, counts), _grouped(values, counts), strict=True)
    ]


def _grouped(flat: pa.Array, counts: np.ndarray) -> list[bytes]:
    """Content of consecutive runs of values, each with its length."""
    ends = np.cumsum(counts, dtype=np.int64)
    starts = ends - counts
    plain_numbers = not flat.null_count and not pa.types.is_string(flat.type)
    if plain_numbers:
        words = _words(flat)
        size, raw = words.dtype.itemsize, words.tobytes()
        runs = [raw[a * size : b * size] for a, b in zip(starts, ends, strict=True)]
    else:
        each = _of_array(flat)
        runs = [b"".join(each[a:b]) for a, b in zip(starts, ends, strict=True)]
    return [int(n).to_bytes(8, "little") + run for n, run in zip(counts, runs, strict=True)]
