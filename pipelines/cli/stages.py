"""Commands that make things: run, generate, segment, train, evaluate, report, results.

Stages are imported when they are called, so that ``lmtr --help`` answers at once.
"""

from enum import StrEnum
from typing import Annotated

import typer

from pipelines.cli import options
from pipelines.cli.options import (
    AtOption,
    ConfigOption,
    DatasetOption,
    HomeOption,
    SetOption,
    VariantOption,
    WorkersOption,
)


class Again(StrEnum):
    """Ends of a solve that tell of the machine rather than of the task."""

    ERROR = "error"
    TIME_LIMIT = "time_limit"


def register(app: typer.Typer) -> None:
    """Add the commands to the application."""
    panel = "Make"
    app.command(rich_help_panel=panel)(run)
    app.command(rich_help_panel=panel)(generate)
    app.command(rich_help_panel=panel)(segment)
    app.command(rich_help_panel=panel)(train)
    app.command(rich_help_panel=panel)(evaluate)
    app.command(rich_help_panel=panel)(report)
    app.command(rich_help_panel=panel)(results)


def run(
    ctx: typer.Context,
    config: Annotated[
        str,
        typer.Argument(
            help="Built-in name (`demo`, `paper`, …) or path of a TOML file.", metavar="CONFIG"
        ),
    ],
    overrides: SetOption = None,
    workers: WorkersOption = None,
    home: HomeOption = None,
) -> None:
    """Do everything: generate, segment, train, evaluate, report.

    Each stage skips what is done and continues what was interrupted, so the same command may be
    repeated at will. A configuration with [[variants]] is a study: all of them are carried out.
    """
    from pipelines.run import run as run_all

    study = options.study(config, overrides, cluster__workers=workers)
    run_all(study, options.workspace(ctx, home, study.base, create=True))


def generate(
    ctx: typer.Context,
    solutions: Annotated[
        int | None,
        typer.Option("--solutions", "-n", help="Tasks to solve; more than before extends the set."),
    ] = None,
    seed: Annotated[
        int | None, typer.Option("--seed", "-s", help="Seed of all tasks and noise.")
    ] = None,
    workers: WorkersOption = None,
    dataset: Annotated[
        str | None,
        typer.Option(
            "--dataset", "-d", help="Go on with this data set, with the settings it was made with."
        ),
    ] = None,
    again: Annotated[
        Again | None,
        typer.Option(
            "--again", help="First drop solutions that ended so, to solve them once more."
        ),
    ] = None,
    config: ConfigOption = None,
    variant: VariantOption = None,
    overrides: SetOption = None,
    home: HomeOption = None,
) -> None:
    """Solve tasks with the expert and add the solutions to the lake.

    The same command goes on where it was stopped: Ctrl-C finishes and keeps what is under way.
    With more `--solutions` it solves the rest only. Changed settings make another data set.
    """
    from pipelines.datasets import continued, require_same
    from pipelines.generate import generate as make

    settings = options.configuration(
        config,
        overrides,
        variant,
        dataset__solutions=solutions,
        dataset__seed=seed,
        cluster__workers=workers,
    )
    space = options.workspace(ctx, home, settings, create=dataset is None)
    if dataset is not None:
        if config or overrides or seed is not None:
            require_same(settings, space, dataset)
        settings = continued(space, dataset, settings, solutions=solutions)
    typer.echo(make(settings, space, again=None if again is None else str(again)))


def segment(
    ctx: typer.Context,
    workers: WorkersOption = None,
    dataset: DatasetOption = None,
    config: ConfigOption = None,
    variant: VariantOption = None,
    overrides: SetOption = None,
    home: HomeOption = None,
) -> None:
    """Cut the accepted solutions into segments of 0.8 s and one swing per leg."""
    from pipelines.segment import segment as cut

    settings = options.configuration(config, overrides, variant, cluster__workers=workers)
    space = options.workspace(ctx, home, settings)
    cut(settings, space, options.dataset_id(space, settings, config, dataset))


def train(
    ctx: typer.Context,
    latent: Annotated[
        str | None,
        typer.Option(
            "--latent", "-l", help="Latent dimensions, e.g. 0,3,6; 0 is the unimodal regressor."
        ),
    ] = None,
    workers: WorkersOption = None,
    dataset: DatasetOption = None,
    config: ConfigOption = None,
    variant: VariantOption = None,
    overrides: SetOption = None,
    at: AtOption = None,
    home: HomeOption = None,
) -> None:
    """Train one model per latent dimension on the segments of a data set."""
    from pipelines.train import train as fit

    settings = options.configuration(
        config,
        overrides,
        variant,
        training__latent=f"[{latent}]" if latent is not None else None,
        cluster__workers=workers,
    )
    space = options.workspace(ctx, home, settings)
    fit(settings, space, options.learning_data(space, settings, config, dataset, at))


def evaluate(
    ctx: typer.Context,
    rollouts: Annotated[
        int | None, typer.Option("--rollouts", "-n", help="Rollouts for each replanner.")
    ] = None,
    workers: WorkersOption = None,
    dataset: DatasetOption = None,
    config: ConfigOption = None,
    variant: VariantOption = None,
    overrides: SetOption = None,
    at: AtOption = None,
    home: HomeOption = None,
) -> None:
    """Roll every trained replanner and the trajectory library out over random obstacle courses."""
    from pipelines.evaluate import evaluate as roll_out

    settings = options.configuration(
        config, overrides, variant, evaluation__rollouts=rollouts, cluster__workers=workers
    )
    space = options.workspace(ctx, home, settings)
    roll_out(settings, space, options.learning_data(space, settings, config, dataset, at))


def report(
    ctx: typer.Context,
    dataset: DatasetOption = None,
    config: ConfigOption = None,
    variant: VariantOption = None,
    overrides: SetOption = None,
    at: AtOption = None,
    home: HomeOption = None,
) -> None:
    """Write the HTML report of a data set, its models and its rollouts."""
    from pipelines.report import report as write

    settings = options.configuration(config, overrides, variant)
    space = options.workspace(ctx, home, settings)
    typer.echo(write(space, options.learning_data(space, settings, config, dataset, at)))


def results(
    ctx: typer.Context,
    config: Annotated[
        str,
        typer.Argument(
            help="Built-in name (`demo`, `paper`, …) or path of a TOML file.", metavar="CONFIG"
        ),
    ],
    films: Annotated[
        bool, typer.Option(help="Draw a film of each kind of replanner; takes a minute.")
    ] = True,
    overrides: SetOption = None,
    home: HomeOption = None,
) -> None:
    """Write the results of a study from what is there: claims, tables, figures, numbers.

    Nothing is made but the page; what the study has not made yet is named on it.
    """
    from pipelines.results import found_parts
    from pipelines.results import results as write
    from pipelines.run import stage_times

    study = options.study(config, overrides)
    space = options.workspace(ctx, home, study.base)
    seconds = stage_times(study, space).seconds
    typer.echo(write(study.name, space, found_parts(study, space), seconds, films=films))
