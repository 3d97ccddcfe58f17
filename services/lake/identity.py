"""Which rows a table lacks, by the columns that tell its rows apart."""

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.dataset as pads

from services.lake.schemas import IDENTITY


def lacking(table: str, kept: pads.Dataset, rows: pa.Table) -> pa.Table:
    """The rows whose identities are not among the kept ones, each once, in their order.

    Raises:
        duckdb.Error: The kept rows cannot be read.
    """
    keys = listed(table)
    numbers = pa.array(np.arange(len(rows)))
    with duckdb.connect(":memory:") as connection:
        connection.register("kept", kept)
        offered = rows.select(IDENTITY[table]).append_column("row number", numbers)
        connection.register("offered", offered)
        first = connection.sql(
            f'SELECT min("row number") AS "row number" FROM offered ANTI JOIN kept USING ({keys}) '
            f"GROUP BY {keys} ORDER BY 1"
        )
        return rows.take(first.fetchnumpy()["row number"])


def listed(table: str) -> str:
    """The columns of a table's identity in SQL."""
    return ", ".join(f'"{key}"' for key in IDENTITY[table])
