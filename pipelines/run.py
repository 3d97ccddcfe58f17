"""All stages in a row: from a configuration to a report."""

import time
from pathlib import Path

from pipelines.config import Configuration
from pipelines.evaluate import evaluate
from pipelines.generate import generate
from pipelines.invocation import command, short
from pipelines.learning_data import learning_data
from pipelines.progress import say
from pipelines.report import report
from pipelines.segment import segment
from pipelines.train import train
from pipelines.workspace import Workspace


def run(config: Configuration, workspace: Workspace) -> Path:
    """Generate, segment, train, evaluate, report; returns the report's page.

    Every stage skips what is done, so an interrupted run goes on where it stopped.
    """
    began = time.monotonic()
    dataset_id = generate(config, workspace)
    segment(config, workspace, dataset_id)
    data = learning_data(config, workspace, dataset_id)
    model_ids = train(config, workspace, data)
    evaluation_ids = evaluate(config, workspace, data, model_ids)
    page = report(workspace, data, model_ids, evaluation_ids, config)
    say(f"\nDone in {time.monotonic() - began:.0f} s.")
    say(f"Report:      {short(page)}")
    say(f"Experiments: {command(workspace)} ui")
    say(
        f"A query:     {command(workspace)} query \"SELECT replanner, summary['close_share'] AS "
        'close FROM evaluations ORDER BY close"'
    )
    return page
