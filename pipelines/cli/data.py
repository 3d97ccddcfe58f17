"""Commands that look at what was made: query, export, show."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from lmtr.errors import ConfigurationError
from pipelines.cli import options
from pipelines.cli.options import HomeOption


class Format(StrEnum):
    """How a query's result is written."""

    TABLE = "table"
    CSV = "csv"
    JSON = "json"
    PARQUET = "parquet"


class Exported(StrEnum):
    """What can be exported."""

    SOLUTIONS = "solutions"
    SEGMENTS = "segments"
    ROLLOUTS = "rollouts"


class Arrays(StrEnum):
    """Files that exports are written to."""

    PARQUET = "parquet"
    NPZ = "npz"


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
    app.command(rich_help_panel=panel)(export)
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


def export(
    ctx: typer.Context,
    what: Annotated[Exported, typer.Argument(help="What to export.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="File to write.")],
    dt: Annotated[
        float, typer.Option("--dt", help="Sample time of solutions (s).", min=1e-4, max=10.0)
    ] = 0.01,
    where: Annotated[
        str | None, typer.Option("--where", help="SQL condition on the rows, e.g. 'accepted'.")
    ] = None,
    limit: Annotated[
        int | None, typer.Option("--limit", help="At most so many rows.", min=1)
    ] = None,
    form: Annotated[
        Arrays, typer.Option("--format", "-f", help="npz: segments alone, as NumPy arrays.")
    ] = Arrays.PARQUET,
    home: HomeOption = None,
) -> None:
    """Write solutions, segments or rollouts to a file, sampled and in SI units (docs/data.md)."""
    from pipelines import export as exports
    from pipelines.export import export_rollouts, export_segments, export_solutions

    space = options.archive(ctx, home)
    if form is Arrays.NPZ:
        if what is not Exported.SEGMENTS:
            raise ConfigurationError(
                f"export: {what} have rows of many lengths and are no arrays; leave --format out"
            )
        typer.echo(f"{out}: {exports.export_segments_npz(space, out, where, limit)} rows")
        return
    count = {
        Exported.SOLUTIONS: lambda: export_solutions(space, out, dt, where, limit),
        Exported.SEGMENTS: lambda: export_segments(space, out, where, limit),
        Exported.ROLLOUTS: lambda: export_rollouts(space, out, where, limit),
    }[what]()
    typer.echo(f"{out}: {count} rows")


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
