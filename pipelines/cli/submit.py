"""The group ``lmtr submit``: every stage with its own options, to be done on a cluster.

The commands are made from those of :mod:`pipelines.cli.stages`, so that whatever can be typed on
one machine can be typed here.
"""

import inspect
import sys
from collections.abc import Callable, Mapping
from typing import Annotated, Any

import typer

from pipelines.cli import options, stages
from pipelines.cli.options import ClusterOption
from pipelines.config import Configuration

app = typer.Typer(
    name="submit",
    help="Do a stage on a Ray cluster: the same words as on this machine, after `submit`.\n\n"
    "`lmtr submit run my.toml --follow` checks the configuration here, sends it to the cluster "
    "with the ordinary command `lmtr run`, prints the job's id and follows its log. Which cluster: "
    "`--cluster http://HOST:8265`, or a profile in the settings file (`docs/cluster.md`). Submit "
    "the same again to go on, whatever stopped it.",
    no_args_is_help=True,
)

SETTINGS = {
    "solutions": "dataset.solutions",
    "seed": "dataset.seed",
    "workers": "cluster.workers",
    "rollouts": "evaluation.rollouts",
}
"""Options of stages that stand for a setting of the configuration."""

WHOLE_STUDIES = ("run", "results")
"""Stages that take a configuration with all of its variants."""

TYPED = "COMMANDLINE"
"""What Typer calls the source of a value that was typed."""

RemoteHomeOption = Annotated[
    str | None,
    typer.Option(
        "--home",
        help="The home as the cluster's machines see it: an absolute folder or s3://bucket/prefix. "
        "[default: the profile's, else their $LMTR_HOME]",
        show_default=False,
    ),
]
FollowOption = Annotated[
    bool, typer.Option("--follow", "-f", help="Show its log until it ends; Ctrl-C only leaves.")
]
AnyVersionOption = Annotated[
    bool, typer.Option("--any-version", help="Even if the cluster has other versions.")
]
OWN = {
    "home": RemoteHomeOption,
    "cluster": ClusterOption,
    "follow": FollowOption,
    "any_version": AnyVersionOption,
}
"""Options of the submission itself."""


def register(main: typer.Typer) -> None:
    """Add the group to the application."""
    for stage in (
        stages.run,
        stages.generate,
        stages.segment,
        stages.train,
        stages.evaluate,
        stages.report,
        stages.results,
    ):
        app.command()(_submitting(stage))
    main.add_typer(app, rich_help_panel="Cluster")


def _submitting(stage: Callable[..., None]) -> Callable[..., None]:
    """The command that submits a stage: its options, and those of a submission."""

    def command(ctx: typer.Context, **_: object) -> None:
        _submit(ctx, stage.__name__)

    theirs = {
        name: each for name, each in inspect.signature(stage).parameters.items() if name not in OWN
    }
    ours = {
        name: inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=None if name in ("home", "cluster") else False,
            annotation=annotation,
        )
        for name, annotation in OWN.items()
    }
    command.__name__ = stage.__name__
    command.__doc__ = f"{inspect.cleandoc(stage.__doc__ or '')}\n\nDone on the cluster, as a job."
    command.__annotations__ = {name: each.annotation for name, each in {**theirs, **ours}.items()}
    signature = inspect.Signature([*theirs.values(), *ours.values()])
    command.__signature__ = signature  # type: ignore[attr-defined]  # what Typer reads
    return command


def _submit(ctx: typer.Context, stage: str) -> None:
    from pipelines.remote.submission import Submission, shown, submit
    from pipelines.remote.watch import follow

    given: Mapping[str, Any] = ctx.params
    settings = _checked(stage, given)
    submission = Submission(
        stage=stage,
        words=_words(ctx),
        config=given["config"],
        config_option="" if stage in WHOLE_STUDIES else "--config",
        dataset_id=given.get("dataset") or (settings.dataset_id if given["config"] else ""),
        command=shown(sys.argv[1:]),
    )
    target = options.target(ctx, given["cluster"], given["home"])
    job_id = submit(submission, target, any_version=given["any_version"])
    typer.echo(job_id)
    if given["follow"]:
        follow(target, job_id, submission.command)


def _checked(stage: str, given: Mapping[str, Any]) -> Configuration:
    """The configuration as the stage will have it, or the error that it would end with."""
    typed = {key: given.get(option) for option, key in SETTINGS.items()}
    if given.get("latent") is not None:
        typed["training.latent"] = f"[{given['latent']}]"
    chosen = {key.replace(".", "__"): value for key, value in typed.items()}
    if stage in WHOLE_STUDIES:
        return options.study(given["config"], given["overrides"], **chosen).base
    return options.configuration(
        given["config"], given["overrides"], given.get("variant"), **chosen
    )


def _words(ctx: typer.Context) -> tuple[str, ...]:
    """The stage's own options as they were typed, but for its configuration and home."""
    words: list[str] = []
    for parameter in ctx.command.params:
        name = parameter.name or ""
        source = ctx.get_parameter_source(name)
        if source is None or source.name != TYPED or name in ("config", *OWN):
            continue
        value = ctx.params[name]
        if isinstance(value, bool):
            words.append((parameter.opts if value else parameter.secondary_opts)[0])
            continue
        for each in value if isinstance(value, list | tuple) else [value]:
            words += [parameter.opts[0], str(each)]
    return tuple(words)
