"""Commands that look after the lakehouse: ``lmtr lake info``, ``check``, ``repair`` and others."""

from datetime import timedelta
from enum import StrEnum
from typing import Annotated

import typer

from pipelines.cli import options
from pipelines.cli.options import HomeOption


class Told(StrEnum):
    """How something is told."""

    TABLE = "table"
    JSON = "json"


class Figures(StrEnum):
    """How figures are told."""

    TABLE = "table"
    JSON = "json"
    CSV = "csv"


TableArgument = Annotated[str, typer.Argument(help="Name of a table.", metavar="TABLE")]
TablesArgument = Annotated[
    list[str] | None, typer.Argument(help="Tables. [default: all]", metavar="[TABLE]...")
]
WhereOption = Annotated[
    str | None, typer.Option("--where", help="SQL condition on the rows, e.g. 'accepted'.")
]
FormatOption = Annotated[Told, typer.Option("--format", "-f", help="How it is told.")]
DryRunOption = Annotated[bool, typer.Option("--dry-run", help="Only say what would be done.")]

lake = typer.Typer(
    help="Look after the lakehouse: what it holds, whether it is whole, and how to mend it.",
    invoke_without_command=True,
)


@lake.callback()
def _overview(ctx: typer.Context) -> None:
    if ctx.invoked_subcommand is None:
        typer.echo(ctx.get_help())


def register(app: typer.Typer) -> None:
    """Add the commands to the application."""
    app.add_typer(lake, name="lake", rich_help_panel="Care")


@lake.command()
def info(ctx: typer.Context, form: FormatOption = Told.TABLE, home: HomeOption = None) -> None:
    """Say what each table takes up: rows, files, bytes, versions, rows of each data set."""
    from pipelines.lake_care.look import info as tell

    tell(options.archive(ctx, home), str(form))


@lake.command()
def history(
    ctx: typer.Context,
    table: TableArgument,
    limit: Annotated[
        int | None, typer.Option("--limit", "-n", min=1, help="Only the newest so many.")
    ] = None,
    form: FormatOption = Told.TABLE,
    home: HomeOption = None,
) -> None:
    """List the versions of a table: when, what, how many rows, and what the writer noted."""
    from pipelines.lake_care.look import history as tell

    tell(options.archive(ctx, home), table, limit, str(form))


@lake.command()
def check(
    ctx: typer.Context,
    tables: TablesArgument = None,
    most: Annotated[
        int, typer.Option("--most", min=1, help="Rows to name of all that break the same thing.")
    ] = 10,
    form: FormatOption = Told.TABLE,
    home: HomeOption = None,
) -> None:
    """Look at every log entry, file and row; exit status 1 if anything is wrong."""
    from pipelines.lake_care.check import check as look

    clean = look(options.archive(ctx, home), tables or (), most, str(form))
    raise typer.Exit(0 if clean else 1)


@lake.command()
def repair(
    ctx: typer.Context,
    tables: TablesArgument = None,
    dry_run: DryRunOption = False,
    home: HomeOption = None,
) -> None:
    """Make damaged tables usable: set damage aside, salvage the rest. Stop writers first."""
    from pipelines.lake_care.check import repair as mend

    mend(options.keeper(ctx, home), tables or (), dry_run=dry_run)


@lake.command()
def compact(ctx: typer.Context, tables: TablesArgument = None, home: HomeOption = None) -> None:
    """Join the small files of many commits into few large ones; old versions stay readable."""
    from pipelines.lake_care.upkeep import compact as join

    join(options.keeper(ctx, home), tables or ())


@lake.command()
def vacuum(
    ctx: typer.Context,
    tables: TablesArgument = None,
    grace: Annotated[
        float, typer.Option("--grace", min=0.0, help="Age in hours that a file must have.")
    ] = 1.0,
    forget_history: Annotated[
        bool,
        typer.Option(
            "--forget-history",
            help="Also files of old versions that no model or evaluation was made from.",
        ),
    ] = False,
    yes: Annotated[
        bool, typer.Option("--yes", "-y", help="Forget history without asking.")
    ] = False,
    dry_run: DryRunOption = False,
    home: HomeOption = None,
) -> None:
    """Delete data files that no version refers to, left by writers that were killed."""
    from pipelines.lake_care.upkeep import vacuum as clear

    clear(
        options.keeper(ctx, home),
        tables or (),
        timedelta(hours=grace),
        forget_history=forget_history,
        confirmed=yes,
        dry_run=dry_run,
    )


@lake.command()
def migrate(ctx: typer.Context, tables: TablesArgument = None, home: HomeOption = None) -> None:
    """Bring tables of an older schema version up to this LMTR's; may be repeated at will."""
    from pipelines.lake_care.upkeep import migrate as bring_up

    bring_up(options.keeper(ctx, home), tables or ())


@lake.command()
def stats(
    ctx: typer.Context,
    table: TableArgument,
    where: WhereOption = None,
    columns: Annotated[
        list[str] | None, typer.Option("--column", "-c", help="Only this column; repeatable.")
    ] = None,
    form: Annotated[
        Figures, typer.Option("--format", "-f", help="How it is told.")
    ] = Figures.TABLE,
    home: HomeOption = None,
) -> None:
    """Statistics of each column: count, nulls, min, max, mean, std, quantiles."""
    from pipelines.lake_care.look import stats as tell

    tell(options.archive(ctx, home), table, where, columns, str(form))


@lake.command()
def sample(
    ctx: typer.Context,
    table: TableArgument,
    count: Annotated[int, typer.Option("--count", "-n", min=1, help="How many rows.")] = 5,
    where: WhereOption = None,
    seed: Annotated[int, typer.Option("--seed", "-s", help="Another seed, other rows.")] = 0,
    form: FormatOption = Told.TABLE,
    home: HomeOption = None,
) -> None:
    """Show rows drawn at random; the same ones for the same seed."""
    from pipelines.lake_care.look import sample as draw

    draw(options.archive(ctx, home), table, count, where, seed, str(form))
