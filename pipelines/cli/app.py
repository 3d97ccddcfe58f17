"""The Typer application: global options, exit statuses, and the one place errors are shown."""

import sys
from typing import Annotated

import typer
from rich.console import Console
from typer.exceptions import TyperException

from lmtr import __version__
from lmtr.errors import LmtrError
from pipelines.cli import care, cluster, data, lake, stages, submit
from pipelines.cli.options import HomeOption, ProfileOption
from pipelines.terminal import printable
from services.errors import LeftRunningError, ServiceError

EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130

app = typer.Typer(
    name="lmtr",
    help="Expert skill-spaces for replanning quadruped locomotion: generate expert data, train "
    "replanners, compare them in rollouts.\n\n"
    "Start with `lmtr run demo`; then look with `lmtr query`, `lmtr show` and `lmtr ui`. Where one "
    "machine is too slow, `lmtr submit run demo` does the same on a cluster.",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode="markdown",
)


def _version(value: bool) -> None:
    if value:
        typer.echo(f"lmtr {__version__}")
        raise typer.Exit


@app.callback()
def _globals(
    home: HomeOption = None,
    profile: ProfileOption = None,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Options before the command."""


stages.register(app)
data.register(app)
lake.register(app)
submit.register(app)
cluster.register(app)
care.register(app)


def main() -> None:
    """Run the command line; faults that a user can mend are one line and exit status 2."""
    try:
        status = app(args=sys.argv[1:] or ["--help"], standalone_mode=False)
        if status == EXIT_INTERRUPTED:  # Typer's own word for Ctrl-C
            raise KeyboardInterrupt
        sys.exit(status)
    except LeftRunningError as error:
        _complain(str(error))
        sys.exit(EXIT_INTERRUPTED)
    except (LmtrError, ServiceError) as error:
        _complain(str(error))
        sys.exit(EXIT_BAD_INPUT)
    except OSError as error:
        _complain(f"{error}; make room or mend permissions, and run the same command to go on")
        sys.exit(EXIT_BAD_INPUT)
    except TyperException as error:
        _complain(f"{error.format_message().rstrip('.')}; see `lmtr --help`")
        sys.exit(EXIT_BAD_INPUT)
    except (KeyboardInterrupt, typer.Abort):
        _complain("interrupted; what was finished is kept: run the same command to go on")
        sys.exit(EXIT_INTERRUPTED)


def _complain(message: str) -> None:
    line = " ".join(printable(message).split())
    Console(stderr=True, highlight=False).print(f"lmtr: {line}", markup=False, soft_wrap=True)
