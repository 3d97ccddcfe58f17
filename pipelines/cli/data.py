"""Commands that look at what was made: query, show, and the group export."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from pipelines.cli import export, options
from pipelines.cli.options import HomeOption


class Format(StrEnum):
    """How a query's result is written."""

    TABLE = "table"
    CSV = "csv"
    JSON = "json"
    PARQUET = "parquet"


class Shown(StrEnum):
    """What can be shown."""

    SOLUTION = "solution"
    ROLLOUT = "rollout"


class Film(StrEnum):
    """Kinds of animation."""

    GIF = "gif"
    MP4 = "mp4"


def register(app: typer.Typer) -> None:
    """Add the commands to the application."""
    panel = "Look"
    app.command(rich_help_panel=panel)(query)
    app.add_typer(export.app, rich_help_panel=panel)
    app.command(rich_help_panel=panel)(show)


def query(
    ctx: typer.Context,
    sql: Annotated[
        str, typer.Argument(help="One SELECT over the tables of the lake.", metavar="SQL")
    ] = "",
    form: Annotated[
        Format, typer.Option("--format", "-f", help="How the result is written.")
    ] = Format.TABLE,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File to write; parquet needs one.")
    ] = None,
    explain: Annotated[
        bool, typer.Option("--explain", help="Show how the query would be carried out.")
    ] = False,
    listed: Annotated[
        bool, typer.Option("--list", help="List the tables and views that there are.")
    ] = False,
    home: HomeOption = None,
) -> None:
    """Ask the lakehouse in SQL (DuckDB), read-only.

    Tables: `datasets`, `solutions`, `segments`, `models`, `evaluations`, `rollouts`; views with
    readable columns: `solutions_overview`, `accepted_by_distance` … (`--list`). For example:

    `lmtr query "SELECT status, count(*), median(solve_cpu_s) FROM solutions GROUP BY ALL"`
    """
    from pipelines import query as asking

    space = options.archive(ctx, home)
    if listed:
        asking.list_tables(space)
    elif explain:
        asking.explain(space, sql)
    else:
        asking.query(space, sql, str(form), out)


def show(
    ctx: typer.Context,
    what: Annotated[Shown, typer.Argument(help="A solution or a rollout.")],
    name: Annotated[
        str,
        typer.Argument(
            help="Index of a solution (or DATASET/INDEX); id of a rollout (see `lmtr query "
            '"SELECT rollout_id FROM rollouts"`).',
            metavar="ID",
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder for the pictures. [default: the home's reports]"),
    ] = None,
    animation: Annotated[
        bool, typer.Option("--animation/--no-animation", help="Also draw the animation.")
    ] = True,
    form: Annotated[
        Film, typer.Option("--format", help="Kind of animation; mp4 needs ffmpeg.")
    ] = Film.GIF,
    home: HomeOption = None,
) -> None:
    """Draw a solution or a rollout: top view, gait diagram, and an animation."""
    from pipelines.show import show_rollout, show_solution

    space = options.archive(ctx, home)
    draw = show_solution if what is Shown.SOLUTION else show_rollout
    for path in draw(space, name, out, animation_format=str(form) if animation else None):
        typer.echo(path)
