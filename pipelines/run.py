"""All stages in a row: from a configuration to a report."""

import shlex
import shutil
import sys
import time
from pathlib import Path

from pipelines.config import Configuration
from pipelines.progress import say
from pipelines.workspace import Workspace


def run(config: Configuration, workspace: Workspace) -> Path:
    """Generate, segment, train, evaluate, report; returns the report's page.

    Every stage skips what is done, so an interrupted run goes on where it stopped.
    """
    from pipelines.evaluate import evaluate
    from pipelines.generate import generate
    from pipelines.report import report
    from pipelines.segment import segment
    from pipelines.train import train

    began = time.monotonic()
    dataset_id = generate(config, workspace).dataset_id
    segment(config, workspace, dataset_id)
    model_ids = train(config, workspace, dataset_id)
    evaluations = evaluate(config, workspace, dataset_id, model_ids)
    page = report(config, workspace, dataset_id, model_ids, evaluations)
    say(f"\nDone in {time.monotonic() - began:.0f} s.")
    _tell_what_next(workspace, page)
    return page


def _tell_what_next(workspace: Workspace, page: Path) -> None:
    command = f"{_command()} --home {shlex.quote(str(_short(workspace.home.root)))}"
    say(f"Report:      {_short(page)}")
    say(f"Experiments: {command} ui")
    say(
        f"A query:     {command} query \"SELECT replanner, summary['close_share'] AS close "
        'FROM evaluations ORDER BY close"'
    )


def _command() -> str:
    """How the user calls ``lmtr`` here: by name where it is on the path."""
    if shutil.which("lmtr") is not None:
        return "lmtr"
    return shlex.quote(str(_short(Path(sys.argv[0]).absolute())))


def _short(path: Path) -> Path:
    """The path as seen from here, where it lies below."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path
