"""Commands that look after the installation: ui, doctor."""

from typing import Annotated

import typer

from pipelines.cli import options
from pipelines.cli.options import ConfigOption, HomeOption, SetOption


def register(app: typer.Typer) -> None:
    """Add the commands to the application."""
    panel = "Care"
    app.command(rich_help_panel=panel)(ui)
    app.command(rich_help_panel=panel)(doctor)
    app.command(hidden=True)(versions)


def ui(
    ctx: typer.Context,
    port: Annotated[
        int, typer.Option("--port", "-p", min=1, max=65535, help="Port on this machine.")
    ] = 5000,
    home: HomeOption = None,
) -> None:
    """Open MLflow's web page on the runs of the home (stop it with Ctrl-C)."""
    from pipelines.ui import serve

    serve(options.archive(ctx, home), port)


def doctor(
    ctx: typer.Context,
    config: ConfigOption = None,
    overrides: SetOption = None,
    home: HomeOption = None,
) -> None:
    """Say what is installed, what is compiled, what can be reached, and how to mend the rest."""
    from pipelines.doctor import examine

    settings = options.configuration(config, overrides)
    healthy = examine(options.resolve_home(ctx, home), settings)
    raise typer.Exit(0 if healthy else 1)


def versions() -> None:
    """Print what a client and a cluster compare of each other, as one line of JSON."""
    from pipelines.remote.versions import say_versions

    typer.echo(say_versions())
