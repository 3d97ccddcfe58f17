"""Options that several commands share, and what they resolve to."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.config import Configuration
from pipelines.study import Study, load_study, load_variant
from pipelines.workspace import Workspace

if TYPE_CHECKING:
    from pipelines.learning_data import LearningData
    from pipelines.remote.target import Target

DEFAULT_HOME = "lmtr-home"

HomeOption = Annotated[
    str | None,
    typer.Option(
        "--home",
        help="Folder, or s3://bucket/prefix, that holds everything: lake, models, runs, reports. "
        "[default: $LMTR_HOME or ./lmtr-home]",
        show_default=False,
    ),
]
ConfigOption = Annotated[
    str | None,
    typer.Option(
        "--config", "-c", help="Built-in name or path of a TOML file. [default: all defaults]"
    ),
]
VariantOption = Annotated[
    str | None,
    typer.Option(
        "--variant", help="One of the variants of the configuration's file. [default: none]"
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="Override one setting: section.key=value (TOML value). May be repeated.",
        metavar="KEY=VALUE",
    ),
]
DatasetOption = Annotated[
    str | None,
    typer.Option("--dataset", "-d", help="Data set id. [default: the newest in the home]"),
]
AtOption = Annotated[
    int | None,
    typer.Option("--at", min=0, help="Version of the table segments. [default: the present one]"),
]
ProfileOption = Annotated[
    str | None,
    typer.Option(
        "--profile",
        help="Cluster of the settings file to use. [default: $LMTR_PROFILE or the file's own]",
        show_default=False,
    ),
]
ClusterOption = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        help="Address of a cluster's dashboard, http://HOST:8265. [default: the profile's]",
        metavar="URL",
        show_default=False,
    ),
]
WorkersOption = Annotated[
    int | None,
    typer.Option(
        "--workers", "-w", min=0, help="Worker processes; 0 works in this one. [default: cores]"
    ),
]


def resolve_home(ctx: typer.Context, home: str | None) -> str:
    """The home given after the command, before it, in LMTR_HOME, or the default, in this order.

    It stays text: as a path, an address would lose one of its slashes.
    """
    return home if home is not None else named_home(ctx) or DEFAULT_HOME


def named_home(ctx: typer.Context) -> str:
    """The home given before the command, else in LMTR_HOME; empty if neither names one."""
    before: str | None = ctx.find_root().params.get("home")
    return before if before is not None else os.environ.get("LMTR_HOME", "")


def cluster_in_use(ctx: typer.Context) -> bool:
    """Whether a command that could be about either is about a cluster, where no option says so.

    It is if ``LMTR_PROFILE`` names a profile, or if no home is named, none is in this folder, and
    the settings file has a profile of its own.
    """
    from services.profiles import PROFILE_VARIABLE, load_settings, settings_file

    if os.environ.get(PROFILE_VARIABLE):
        return True
    if named_home(ctx) or Path(DEFAULT_HOME).exists():
        return False
    return load_settings(settings_file()).profile is not None


def target(ctx: typer.Context, cluster: str | None, home: str | None = None) -> "Target":
    """The cluster that the options name, for a command that is about one.

    Its home is the one typed, else the profile's: this machine's ``LMTR_HOME`` says nothing of it.
    """
    from pipelines.remote.target import find_target

    before: dict[str, str | None] = ctx.find_root().params
    return find_target(before.get("profile"), cluster, home or before.get("home"))


def configuration(
    config: str | None,
    overrides: list[str] | None,
    variant: str | None = None,
    **options: object,
) -> Configuration:
    """The configuration with ``--set`` overrides and then the command's own options applied.

    Args:
        config: Built-in name, path, or None.
        overrides: ``section.key=value`` as typed.
        variant: One of the configuration's variants; None for what they vary.
        options: Dotted keys with ``__`` for the dot; None leaves a setting as it is.
    """
    return load_variant(config, _typed(overrides, options), variant)


def study(config: str, overrides: list[str] | None, **options: object) -> Study:
    """The same with all variants."""
    return load_study(config, _typed(overrides, options))


def _typed(overrides: list[str] | None, options: Mapping[str, object]) -> list[str]:
    given = [
        f"{key.replace('__', '.')}={value}" for key, value in options.items() if value is not None
    ]
    return [*(overrides or []), *given]


def workspace(
    ctx: typer.Context, home: str | None, config: Configuration, *, create: bool = False
) -> Workspace:
    """The workspace that the options name, for a command that writes to it."""
    space = Workspace.open(resolve_home(ctx, home), config.cluster, create=create)
    space.home.require_writable()
    return space


def archive(ctx: typer.Context, home: str | None) -> Workspace:
    """The workspace that the options name, for a command that only reads it."""
    return Workspace.open(resolve_home(ctx, home), Configuration().cluster, create=False)


def keeper(ctx: typer.Context, home: str | None) -> Workspace:
    """The workspace that the options name, for a command that looks after what is in it."""
    return workspace(ctx, home, Configuration())


def dataset_id(
    space: Workspace, settings: Configuration, config: str | None, dataset: str | None
) -> str:
    """The data set named by ``--dataset``, else by ``--config``, else the newest."""
    from pipelines.datasets import resolve

    return resolve(space, dataset, settings.dataset_id if config else None)


def learning_data(
    space: Workspace,
    settings: Configuration,
    config: str | None,
    dataset: str | None,
    at: int | None = None,
) -> "LearningData":
    """The segments of that data set, in a version of their table."""
    from pipelines.learning_data import learning_data as segments_of

    return segments_of(settings, space, dataset_id(space, settings, config, dataset), at)
