"""Commands that look at a cluster's jobs and stop them: jobs, logs, cancel, status."""

from typing import Annotated

import typer

from pipelines.cli import options
from pipelines.cli.options import ClusterOption

JobArgument = Annotated[str, typer.Argument(help="A job's id, as `lmtr jobs` lists it.")]


def register(app: typer.Typer) -> None:
    """Add the commands to the application."""
    panel = "Cluster"
    app.command(rich_help_panel=panel)(jobs)
    app.command(rich_help_panel=panel)(logs)
    app.command(rich_help_panel=panel)(cancel)
    app.command(rich_help_panel=panel)(status)


def jobs(
    ctx: typer.Context,
    form_json: Annotated[bool, typer.Option("--json", help="As JSON, for programs.")] = False,
    all_jobs: Annotated[
        bool, typer.Option("--all", help="Also jobs that `lmtr submit` did not send.")
    ] = False,
    cluster: ClusterOption = None,
) -> None:
    """List the jobs of the cluster: stage, status, since when, how long, configuration."""
    from pipelines.remote.tables import show_jobs

    show_jobs(options.target(ctx, cluster), form_json=form_json, all_jobs=all_jobs)


def logs(
    ctx: typer.Context,
    job: JobArgument,
    follow: Annotated[
        bool, typer.Option("--follow", "-f", help="Go on until the job ends; Ctrl-C only leaves.")
    ] = False,
    lines: Annotated[
        int | None, typer.Option("--lines", "-n", min=0, help="Only the last lines so far.")
    ] = None,
    cluster: ClusterOption = None,
) -> None:
    """Show what a job has said; with `-f` go on as it says more.

    Ctrl-C leaves the job running. The exit status of `-f` is 0 where the job succeeded.
    """
    from pipelines.remote import watch

    target = options.target(ctx, cluster)
    if follow:
        watch.follow(target, job)
    else:
        watch.show_log(target, job, lines)


def cancel(ctx: typer.Context, job: JobArgument, cluster: ClusterOption = None) -> None:
    """Stop a job: it finishes and keeps what is under way, and this waits and says how it ended.

    Submitting the same again goes on from there.
    """
    from pipelines.remote.watch import cancel as stop

    stop(options.target(ctx, cluster), job)


def status(ctx: typer.Context, cluster: ClusterOption = None) -> None:
    """Show the cluster's machines, and how far the jobs are that run on it."""
    from pipelines.remote.tables import show_status

    show_status(options.target(ctx, cluster))
