"""Selection of rollouts from records that hold one entry each along their arrays' first axis."""

from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar, cast

from lmtr.arrays import Flags, Indices

Record = TypeVar("Record")


def taken(record: Record, rows: Indices | Flags) -> Record:
    """The same record of the chosen ``rows`` only; records inside it are cut alike.

    Args:
        record: A dataclass of arrays (n, ...) and of such dataclasses.
        rows: Indices or a mask along the first axis.
    """
    whole = cast(Any, record)
    chosen: dict[str, Any] = {}
    for field in fields(whole):
        value = getattr(whole, field.name)
        chosen[field.name] = taken(value, rows) if is_dataclass(value) else value[rows]
    return cast(Record, replace(whole, **chosen))
