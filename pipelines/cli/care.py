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
    app.command(hidden=True)(examine)


def ui(
    ctx: typer.Context,
    port: Annotated[
        int, typer.Option("--port", "-p", min=1, max=65535, help="Port on this machine.")
    ] = 5000,
    home: HomeOption = None,
    cluster: Annotated[
        bool, typer.Option("--cluster", help="Say where the pages of the cluster in use are.")
    ] = False,
) -> None:
    """Open MLflow's web page on the runs of the home (stop it with Ctrl-C).

    With `--cluster`, or a `--profile` before the command, it is the page of that cluster, which its
    own server shows. So it is where no home is named and none is here, but the settings file names
    a cluster. A home that is typed is one of this machine, whatever `LMTR_PROFILE` says.
    """
    typed = home if home is not None else ctx.find_root().params.get("home")
    chosen = cluster or ctx.find_root().params.get("profile") is not None
    if chosen and typed is not None:
        raise typer.BadParameter(
            f"the home {typed} is this machine's, and its page no cluster's; leave out the one or "
            "the other"
        )
    if chosen or (typed is None and options.cluster_in_use(ctx)):
        from pipelines.remote.pages import show_pages

        show_pages(options.target(ctx, None))
        return
    from pipelines.ui import serve

    serve(options.archive(ctx, home), port)


def doctor(
    ctx: typer.Context,
    config: ConfigOption = None,
    overrides: SetOption = None,
    home: HomeOption = None,
    cluster: Annotated[
        bool, typer.Option("--cluster", help="Look over a cluster instead of this machine.")
    ] = False,
    url: Annotated[
        str | None,
        typer.Argument(
            help="With --cluster: address of its dashboard, http://HOST:8265. "
            "[default: the profile's]",
            show_default=False,
        ),
    ] = None,
    form_json: Annotated[bool, typer.Option("--json", help="As JSON, for programs.")] = False,
) -> None:
    """Say what is installed, what is compiled, what can be reached, and how to mend the rest.

    With `--cluster` of a cluster: is it reached, who is let in, and for each of its nodes
    versions, clock, memory, room, compiler; the home and MLflow as its head sees them.
    """
    if cluster:
        from pipelines.checkup.cluster import examine as examine_cluster

        if config is not None or overrides:
            raise typer.BadParameter("--config and --set are about this machine, not a --cluster")
        healthy = examine_cluster(lambda: options.target(ctx, url, home), form_json=form_json)
        raise typer.Exit(0 if healthy else 1)
    if url is not None:
        raise typer.BadParameter(f"to look over the cluster at {url}, put --cluster before it")
    from pipelines.doctor import examine

    settings = options.configuration(config, overrides)
    healthy = examine(options.resolve_home(ctx, home), settings, form_json=form_json)
    raise typer.Exit(0 if healthy else 1)


def examine(ctx: typer.Context) -> None:
    """Print what a cluster tells `lmtr doctor --cluster` of itself, as one line of JSON."""
    from pipelines.checkup.examine import say_report

    typer.echo(say_report(options.named_home(ctx)))


def versions() -> None:
    """Print what a client and a cluster compare of each other, as one line of JSON."""
    from pipelines.remote.versions import say_versions

    typer.echo(say_versions())
