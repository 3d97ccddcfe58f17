"""A home that was moved or copied keeps its runs' files: MLflow stores where they lie as absolute.

MLflow has no call that changes the place of an experiment's files, so its SQLite file is mended.
"""

import sqlite3
from contextlib import closing
from pathlib import Path

SQLITE = "sqlite:///"

PLACES = (
    ("experiments", "artifact_location"),
    ("runs", "artifact_uri"),
    ("model_versions", "source"),
    ("model_versions", "storage_location"),
)
"""Tables and columns that hold where files lie."""


def follow_moved_artifacts(uri: str, artifacts: Path) -> None:
    """Point all experiments and runs of a SQLite tracker at ``artifacts`` below its home.

    Only places that end in the same folder name are changed: those that this tracker made. A
    database elsewhere belongs to others as well and is left alone.
    """
    if not uri.startswith(SQLITE) or Path(uri.removeprefix(SQLITE)).parent != artifacts.parent:
        return
    here = artifacts.as_uri()
    with closing(sqlite3.connect(uri.removeprefix(SQLITE))) as database, database:
        found = database.execute("SELECT DISTINCT artifact_location FROM experiments").fetchall()
        moved = [
            place for (place,) in found if place != here and place.endswith(f"/{artifacts.name}")
        ]
        for place in moved:
            for table, column in PLACES:
                database.execute(
                    f"UPDATE {table} SET {column} = ? || substr({column}, ?) "
                    f"WHERE {column} = ? OR {column} LIKE ? || '/%'",
                    (here, len(place) + 1, place, place),
                )
