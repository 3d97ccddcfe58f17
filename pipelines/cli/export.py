"""The group of commands that write what the home holds to files: ``lmtr export …``."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lmtr.errors import ConfigurationError
from pipelines.cli import options
from pipelines.cli.options import ConfigOption, DatasetOption, HomeOption, SetOption

if TYPE_CHECKING:
    from lmtr.policies.distance import TaskWeights

app = typer.Typer(
    name="export",
    help="Write solutions, segments, rollouts or a replanner to files (docs/data.md).",
    no_args_is_help=True,
)


class Arrays(StrEnum):
    """Files that exports are written to."""

    PARQUET = "parquet"
    NPZ = "npz"


class Policy(StrEnum):
    """How an exported replanner selects its mode."""

    NEAREST = "nearest"
    SELECTED = "selected"
    GAUSSIAN = "gaussian"
    ZERO = "zero"


OutOption = Annotated[Path, typer.Option("--out", "-o", help="File to write.")]
WhereOption = Annotated[
    str | None, typer.Option("--where", help="SQL condition on the rows, e.g. 'accepted'.")
]
LimitOption = Annotated[int | None, typer.Option("--limit", help="At most so many rows.", min=1)]
FormatOption = Annotated[
    Arrays, typer.Option("--format", "-f", help="npz: segments alone, as NumPy arrays.")
]


@app.command()
def solutions(
    ctx: typer.Context,
    out: OutOption,
    dt: Annotated[
        float, typer.Option("--dt", help="Sample time of solutions (s).", min=1e-4, max=10.0)
    ] = 0.01,
    where: WhereOption = None,
    limit: LimitOption = None,
    form: FormatOption = Arrays.PARQUET,
    home: HomeOption = None,
) -> None:
    """Write the expert's solutions, sampled, in SI units."""
    from pipelines.export import export_solutions

    _require_parquet(form, "solutions")
    count = export_solutions(options.archive(ctx, home), out, dt, where, limit)
    typer.echo(f"{out}: {count} rows")


@app.command()
def segments(
    ctx: typer.Context,
    out: OutOption,
    where: WhereOption = None,
    limit: LimitOption = None,
    form: FormatOption = Arrays.PARQUET,
    home: HomeOption = None,
) -> None:
    """Write segments (x, τ) with their layouts."""
    from pipelines.export import export_segments, export_segments_npz

    write = export_segments_npz if form is Arrays.NPZ else export_segments
    typer.echo(f"{out}: {write(options.archive(ctx, home), out, where, limit)} rows")


@app.command()
def rollouts(
    ctx: typer.Context,
    out: OutOption,
    where: WhereOption = None,
    limit: LimitOption = None,
    form: FormatOption = Arrays.PARQUET,
    home: HomeOption = None,
) -> None:
    """Write rollouts, sampled, with footholds and obstacles in files beside them."""
    from pipelines.export import export_rollouts

    _require_parquet(form, "rollouts")
    typer.echo(f"{out}: {export_rollouts(options.archive(ctx, home), out, where, limit)} rows")


@app.command()
def replanner(
    ctx: typer.Context,
    source: Annotated[
        str, typer.Argument(help="Id of a model, or `library`.", metavar="MODEL|library")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="New folder to write.")],
    policy: Annotated[
        Policy, typer.Option("--policy", help="How the mode of a plan is selected.")
    ] = Policy.NEAREST,
    weights: Annotated[
        str | None,
        typer.Option(
            "--weights",
            help="Weights of base, feet, obstacles and goal in the look-up, e.g. 1,1,5,0.5. "
            "[default: the evaluation's first]",
        ),
    ] = None,
    rows: Annotated[
        int | None,
        typer.Option("--rows", min=2, help="Look up at most so many segments. [default: all]"),
    ] = None,
    dataset: DatasetOption = None,
    config: ConfigOption = None,
    overrides: SetOption = None,
    home: HomeOption = None,
) -> None:
    """Write a complete replanner to a folder that plans without this home (docs/planner.md).

    Loading it needs NumPy, and neither PyTorch, Ray, MLflow nor the lake.
    """
    import numpy as np

    from pipelines.export_replanner import export_replanner

    found = export_replanner(
        options.configuration(config, overrides),
        options.archive(ctx, home),
        source,
        out,
        policy=policy.value,
        weights=_weights(weights),
        rows=rows,
        dataset_id=dataset,
    )
    look_up = f", {found.rows} segments to look up" if found.rows else ""
    middle, late = 1e3 * np.percentile(found.seconds, [50, 99])
    typer.echo(f"{found.folder}: {found.name}, {found.nbytes / 1e6:.1f} MB{look_up}")
    typer.echo(f"one plan: {middle:.2f} ms (median), {late:.2f} ms (p99); to plan with it:\n")
    typer.echo("from pathlib import Path")
    typer.echo("from lmtr.replanners import artifact")
    typer.echo(f"tau = artifact.load(Path({str(found.folder)!r})).plan(x)  # (B, 35) → (B, 264)")


def _require_parquet(form: Arrays, what: str) -> None:
    if form is Arrays.NPZ:
        raise ConfigurationError(
            f"export: {what} have rows of many lengths and are no arrays; leave --format out"
        )


def _weights(text: str | None) -> "TaskWeights | None":
    from lmtr.policies.distance import TaskWeights

    if text is None:
        return None
    try:
        return TaskWeights.of([float(value) for value in text.split(",")])
    except ValueError as error:
        raise ConfigurationError(
            f"export: --weights must be four numbers of at least 0, with commas and not all 0, got "
            f"{text!r}; e.g. 1,1,5,0.5"
        ) from error
