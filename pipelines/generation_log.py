"""A generation in the experiment tracker: its settings, and its figures over time."""

import logging
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager

from pipelines.config import Configuration
from pipelines.datasets import DECIDING
from pipelines.generation_tally import GenerationTally
from pipelines.provenance import code_version
from pipelines.workspace import Workspace
from services.cluster.delivery import Note, Trouble
from services.errors import TrackingError
from services.lake.sink import Receipt
from services.tracking.run import Run

EXPERIMENT = "generation"

EVERY_S = 30.0
"""Figures go to the tracker together, so often (s)."""

SILENT_S = 600.0
"""A call elsewhere of which nothing was heard so long was killed (s)."""

logger = logging.getLogger(__name__)


class LoggedTally:
    """A tally whose figures also go to a run of the tracker, by the number of rows committed.

    A tracker that does not work costs its record and nothing else.
    """

    def __init__(self, tally: GenerationTally, run: Run | None) -> None:
        self._tally = tally
        self._run = run
        self._points: list[tuple[str, float, int]] = []
        self._sent = time.monotonic()

    def add(self, note: Note) -> int:
        """Count one solution."""
        return self._tally.add(note)

    def trouble(self, trouble: Trouble) -> int:
        """Count what went wrong and was mended."""
        return self._tally.trouble(trouble)

    def kept(self, receipt: Receipt) -> None:
        """Take note of a commit, and of all figures at that time."""
        self._tally.kept(receipt)
        step = self._tally.committed
        self._points += [(name, value, step) for name, value in self._tally.numbers().items()]
        if time.monotonic() - self._sent > EVERY_S:
            self.send()

    def words(self) -> str:
        """All of it in a few words."""
        return self._tally.words()

    def figures(self) -> Mapping[str, str]:
        """All of it by name."""
        return self._tally.figures()

    def send(self) -> None:
        """Give the tracker what has come together."""
        self._sent = time.monotonic()
        points, self._points = self._points, []
        if self._run is None or not points:
            return
        try:
            self._run.metrics(points)
        except TrackingError as error:
            logger.warning("generate: its figures are missing in the tracker: %s", error)


@contextmanager
def generation_log(
    config: Configuration, workspace: Workspace, tally: GenerationTally
) -> Iterator[LoggedTally]:
    """A run of the tracker for one call of ``lmtr generate``.

    Earlier calls that were killed, and could not tell, are told to be so. No other is at work on
    a home that is a folder; one in an object store may be worked on from elsewhere.

    What ends the block ends the run, and is what the user hears of, whatever the tracker says.
    """
    stack = ExitStack()
    logged = LoggedTally(tally, _run(stack, config, workspace))
    try:
        yield logged
    except BaseException as error:
        logged.send()
        _end(stack, error)
        raise
    logged.send()
    _end(stack, None)


def _end(stack: ExitStack, error: BaseException | None) -> None:
    """Close the run as finished, failed or killed."""
    try:
        stack.__exit__(type(error) if error else None, error, None)
    except TrackingError as fault:
        logger.warning("generate: the tracker keeps no end of this run: %s", fault)
    except BaseException as same:
        if same is not error:
            raise


def _run(stack: ExitStack, config: Configuration, workspace: Workspace) -> Run | None:
    parameters = config.model_dump(mode="json", include=set(DECIDING))
    tags = {
        "dataset_id": config.dataset_id,
        "code_version": code_version(),
        "stage": "generate",
    }
    try:
        experiment = workspace.tracker.experiment(EXPERIMENT)
        _end_lost(workspace, experiment, config.dataset_id)
        run: Run = stack.enter_context(
            workspace.tracker.run(experiment, config.dataset_id, parameters, tags)
        )
    except TrackingError as error:
        logger.warning("generate: the tracker keeps no record of this run: %s", error)
        return None
    return run


def _end_lost(workspace: Workspace, experiment: str, dataset_id: str) -> None:
    """End runs of calls that were killed; what is wrong with them costs nothing else."""
    silent_s = 0.0 if workspace.home.access is None else SILENT_S
    try:
        workspace.tracker.end_lost(experiment, {"dataset_id": dataset_id}, silent_s)
    except TrackingError as error:
        logger.warning("generate: earlier runs that were killed may seem to go on: %s", error)
